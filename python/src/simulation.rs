//! Simulation of one snow sample.
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use splitsnow::config::sample;
use splitsnow::engine::{Engine, EngineError, MaxError};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::simulation::{RAYS, Simulation};

use crate::pool::pool;

/// Interval between checks for Ctrl-C.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

fn refuse(message: impl ToString) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// Largest Delta-E and RMSE allowed for `auto`, if given.
type Bounds = (Option<f64>, Option<f64>);

/// The error allowed at these wavelengths, and the default number of walks.
fn bounds(given: Option<Bounds>, engine: Engine, nm: &[f64]) -> PyResult<(MaxError, u64)> {
    let mut allowed = MaxError::default_for(nm);
    let Some((delta_e, rmse)) = given else {
        return Ok((allowed, RAYS));
    };
    if engine != Engine::Auto {
        return Err(refuse(
            "max_error is for the engine `auto` only; give rays for other engines",
        ));
    }
    let bounds = [
        ("delta_e", delta_e, &mut allowed.delta_e, 100.0),
        ("rmse", rmse, &mut allowed.rmse, 1.0),
    ];
    for (name, value, bound, most) in bounds {
        match value {
            Some(value) if value > 0.0 && value <= most => *bound = value,
            Some(value) => {
                let message =
                    format!("max_error[\"{name}\"] = {value} must be above 0 and at most {most}");
                return Err(refuse(message));
            }
            None => {}
        }
    }
    let rays = allowed.rays(nm);
    Ok((allowed, rays))
}

/// Simulates the sample in `file`: its path, for messages and for relative paths in it, its
/// text, and whether the text is JSON instead of TOML.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    file: (String, String, bool),
    engine: &str,
    rays: Option<u64>,
    seed: u64,
    max_error: Option<Bounds>,
) -> PyResult<Bound<'py, PyDict>> {
    let (name, text, json) = file;
    let text = if json {
        let value: toml::Value = serde_json::from_str(&text).map_err(refuse)?;
        toml::to_string(&value).map_err(refuse)?
    } else {
        text
    };
    let sample = sample::parse(&name, &text).map_err(refuse)?;
    let found = Engine::named(engine);
    let names = Engine::ALL.map(Engine::name).join(", ");
    let unknown = || refuse(format!("no engine is named `{engine}`; use one of {names}"));
    let engine = found.ok_or_else(unknown)?;
    let (max_error, default_rays) = bounds(max_error, engine, &sample.wavelengths_nm)?;
    let rays = rays.unwrap_or(default_rays);
    if rays == 0 {
        return Err(refuse("rays = 0 is not allowed; it must be at least 1"));
    }
    let simulation = Simulation::of(&sample)
        .engine(engine)
        .rays(rays)
        .seed(seed)
        .max_error(max_error);
    let pool = pool(py)?;
    let spectrum = py.detach(|| interruptible(&pool, &simulation))?;

    let list = |values: &[Measured], part: fn(&Measured) -> f64| {
        PyArray1::from_iter(py, values.iter().map(part))
    };
    let (r, t) = (&spectrum.reflectance, &spectrum.transmittance);
    let both = || r.iter().zip(t);
    let absorptance = both().map(|(r, t)| 1.0 - r.value - t.value);
    let absorptance_se = both().map(|(r, t)| r.se + t.se);
    let result = PyDict::new(py);
    result.set_item(
        "wavelengths_nm",
        PyArray1::from_slice(py, &sample.wavelengths_nm),
    )?;
    result.set_item("reflectance", list(r, |m| m.value))?;
    result.set_item("reflectance_se", list(r, |m| m.se))?;
    result.set_item("transmittance", list(t, |m| m.value))?;
    result.set_item("transmittance_se", list(t, |m| m.se))?;
    result.set_item("absorptance", PyArray1::from_iter(py, absorptance))?;
    result.set_item("absorptance_se", PyArray1::from_iter(py, absorptance_se))?;
    result.set_item("lost_share", PyArray1::from_slice(py, &spectrum.lost))?;
    result.set_item("engine", simulation.resolved().name())?;
    result.set_item("rays", rays)?;
    result.set_item("seed", seed)?;
    result.set_item("warnings", sample.warnings.clone())?;
    result.set_item("notes", sample.notes.clone())?;
    Ok(result)
}

/// Runs `simulation`, and cancels it when Python receives a signal such as Ctrl-C.
fn interruptible(pool: &ThreadPool, simulation: &Simulation) -> PyResult<Spectrum> {
    let cancel = AtomicBool::new(false);
    let simulation = simulation.clone().cancel(&cancel);
    let mut signal = Ok(());
    let (sender, receiver) = mpsc::channel();
    let spectrum = std::thread::scope(|scope| {
        scope.spawn(|| {
            // also dropped on a panic, which the scope propagates
            let sender = sender;
            let _ = sender.send(pool.install(|| simulation.run()));
        });
        loop {
            match receiver.recv_timeout(SIGNAL_INTERVAL) {
                Ok(result) => return result,
                Err(RecvTimeoutError::Disconnected) => return Err(EngineError::Cancelled),
                Err(RecvTimeoutError::Timeout) if signal.is_ok() => {
                    signal = Python::attach(|py| py.check_signals());
                    cancel.store(signal.is_err(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    });
    signal?;
    spectrum.map_err(refuse)
}
