//! Simulation of one snow sample.
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use splitsnow::config::sample::{self, SampleFile};
use splitsnow::engine::profile::LightAtDepth;
use splitsnow::engine::{self, Engine, EngineError, MaxError};
use splitsnow::measurement::Measured;
use splitsnow::simulation::{RAYS, Simulation, default_rays};
use splitsnow::units::m_to_cm;

use crate::pool::pool;

/// Interval between checks for Ctrl-C.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

fn refuse(message: impl ToString) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// Largest Delta-E and RMSE allowed for `auto`, if given.
type Bounds = (Option<f64>, Option<f64>);

/// The error allowed at these wavelengths.
fn bounds(given: Option<Bounds>, engine: Engine, nm: &[f64]) -> PyResult<MaxError> {
    let mut allowed = MaxError::default_for(nm);
    let Some((delta_e, rmse)) = given else {
        return Ok(allowed);
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
    Ok(allowed)
}

/// A sample: its path, for messages and for relative paths in it, its text, and whether the text is
/// JSON instead of TOML.
type SampleText = (String, String, bool);

fn read((name, text, json): SampleText) -> PyResult<SampleFile> {
    let text = if json {
        let value: toml::Value = serde_json::from_str(&text).map_err(refuse)?;
        toml::to_string(&value).map_err(refuse)?
    } else {
        text
    };
    sample::parse(&name, &text).map_err(refuse)
}

fn named(engine: &str) -> PyResult<Engine> {
    let names = Engine::ALL.map(Engine::name).join(", ");
    let unknown = || refuse(format!("no engine is named `{engine}`; use one of {names}"));
    Engine::named(engine).ok_or_else(unknown)
}

/// Refuses 0 walks.
fn some(rays: u64) -> PyResult<u64> {
    match rays {
        0 => Err(refuse("rays = 0 is not allowed; it must be at least 1")),
        rays => Ok(rays),
    }
}

/// Simulates the light inside the sample in `file` at `depths_cm`.
#[pyfunction]
pub(crate) fn profile<'py>(
    py: Python<'py>,
    file: SampleText,
    depths_cm: Vec<f64>,
    engine: &str,
    rays: Option<u64>,
    seed: u64,
) -> PyResult<Bound<'py, PyDict>> {
    let (sample, engine) = (read(file)?, named(engine)?);
    let rays = some(rays.unwrap_or(RAYS))?;
    let simulation = Simulation::of(&sample).engine(engine).rays(rays).seed(seed);
    let depths_m: Vec<f64> = depths_cm.iter().map(|cm| cm / 100.0).collect();
    let pool = pool(py)?;
    let run = |simulation: &Simulation| simulation.profile(&depths_m);
    let found = py.detach(|| interruptible(&pool, &simulation, run))?;
    let engine = engine::profile::engine(engine, &simulation.detailed_request());

    let depths = found.depths_m().len();
    let places = (0..found.wavelengths()).flat_map(|w| (0..depths).map(move |d| (w, d)));
    let light: Vec<LightAtDepth> = places.map(|(w, d)| found.at(w, d)).collect();
    let result = PyDict::new(py);
    let columns = |name: &str, part: &dyn Fn(&LightAtDepth) -> Option<Measured>| {
        let all: Vec<Measured> = light.iter().filter_map(part).collect();
        let values = PyArray1::from_iter(py, all.iter().map(|m| m.value));
        let errors = PyArray1::from_iter(py, all.iter().map(|m| m.se));
        result.set_item(name, values)?;
        result.set_item(format!("{name}_se"), errors)
    };
    columns("downwelling", &|light| Some(light.downwelling))?;
    columns("upwelling", &|light| Some(light.upwelling))?;
    columns("actinic", &|light| Some(light.actinic))?;
    columns("absorbed_per_m", &|light| light.absorbed_per_m)?;
    let depths_cm = found.depths_m().iter().map(|m| m_to_cm(*m));
    result.set_item("depths_cm", PyArray1::from_iter(py, depths_cm))?;
    result.set_item(
        "wavelengths_nm",
        PyArray1::from_slice(py, &sample.wavelengths_nm),
    )?;
    result.set_item("lost_share", found.lost)?;
    result.set_item("engine", engine.name())?;
    result.set_item("rays", rays)?;
    result.set_item("seed", seed)?;
    result.set_item("warnings", sample.warnings.clone())?;
    result.set_item("notes", sample.notes.clone())?;
    Ok(result)
}

/// Simulates the sample in `file`.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    file: SampleText,
    engine: &str,
    rays: Option<u64>,
    seed: u64,
    max_error: Option<Bounds>,
) -> PyResult<Bound<'py, PyDict>> {
    let (sample, engine) = (read(file)?, named(engine)?);
    let to_error = max_error.is_some() && rays.is_none();
    let simulation = Simulation::of(&sample)
        .engine(engine)
        .rays(some(rays.unwrap_or(default_rays(engine)))?)
        .seed(seed)
        .max_error(bounds(max_error, engine, &sample.wavelengths_nm)?);
    let pool = pool(py)?;
    let run = |simulation: &Simulation| {
        let (last, spectrum) = match to_error {
            true => simulation.run_to_error()?,
            false => (simulation.clone(), simulation.run()?),
        };
        Ok((last.resolved(), last.request().rays, spectrum))
    };
    let (engine, rays, spectrum) = py.detach(|| interruptible(&pool, &simulation, run))?;

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
    result.set_item("engine", engine.name())?;
    result.set_item("rays", rays)?;
    result.set_item("seed", seed)?;
    result.set_item("warnings", sample.warnings.clone())?;
    result.set_item("notes", sample.notes.clone())?;
    Ok(result)
}

/// Runs `work` with `simulation`, and cancels it when Python receives a signal such as Ctrl-C.
fn interruptible<T: Send>(
    pool: &ThreadPool,
    simulation: &Simulation,
    work: impl Fn(&Simulation) -> Result<T, EngineError> + Sync,
) -> PyResult<T> {
    let cancel = AtomicBool::new(false);
    let simulation = simulation.clone().cancel(&cancel);
    let mut signal = Ok(());
    let (sender, receiver) = mpsc::channel();
    let result = std::thread::scope(|scope| {
        scope.spawn(|| {
            // also dropped on a panic, which the scope propagates
            let sender = sender;
            let _ = sender.send(pool.install(|| work(&simulation)));
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
    result.map_err(refuse)
}
