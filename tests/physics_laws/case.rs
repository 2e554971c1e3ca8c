//! Measurements for the tests of snowpacks, and the snow that they use.
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::measurement::Spectrum;
use splitsnow::optics::Carbon;
use splitsnow::spectrum::Table;
use splitsnow::transport::{Illumination, Joining, Layer, Model, Snow, Snowpack, Substrate};

use super::assert_close;
use crate::snow::{beam, snow};

pub(crate) const NM: [f64; 3] = [450.0, 850.0, 1250.0];

/// A measurement without the number of rays and the seed.
#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) engine: Engine,
    pub(crate) snowpack: Snowpack,
    pub(crate) model: Model,
    pub(crate) thicknesses_m: Vec<f64>,
    pub(crate) light: Illumination,
    pub(crate) nm: Vec<f64>,
}

impl Case {
    pub(crate) fn new(snowpack: impl Into<Snowpack>, thickness_m: f64) -> Self {
        Self {
            engine: Engine::Spectral,
            snowpack: snowpack.into(),
            model: Model::default(),
            thicknesses_m: vec![thickness_m],
            light: beam(30.0),
            nm: NM.to_vec(),
        }
    }

    pub(crate) fn with_engine(&self, engine: Engine) -> Self {
        Self {
            engine,
            ..self.clone()
        }
    }

    pub(crate) fn cascade(&self) -> Self {
        let mut case = self.clone();
        case.model.joining = Joining::Cascade;
        case
    }

    pub(crate) fn run_all(&self, rays: u64, seed: u64) -> Vec<Spectrum> {
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m: &self.thicknesses_m,
            illuminations: &[self.light],
            resolution: Resolution::for_rays(rays),
            max_error: MaxError::default(),
            wavelengths_nm: &self.nm,
            model: &self.model,
            rays,
            seed,
            cell: 0,
        };
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        let cache = Cache::default();
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let spectra = self.engine.run(&request, &control).unwrap();
        assert_eq!(
            rays_done.into_inner(),
            self.engine.walks(&request).unwrap(),
            "the number of walks differs from the prediction"
        );
        spectra
    }

    pub(crate) fn run(&self, rays: u64, seed: u64) -> Spectrum {
        self.run_all(rays, seed).remove(0)
    }
}

/// Asserts that two spectra agree within their joint standard errors.
pub(crate) fn assert_same(label: &str, a: &Spectrum, b: &Spectrum) {
    let both = [
        ("R", &a.reflectance, &b.reflectance),
        ("T", &a.transmittance, &b.transmittance),
    ];
    for (quantity, a, b) in both {
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            let label = format!("{label}, {quantity} {i}");
            assert_close(&label, a.value, a.se.hypot(b.se), b.value);
        }
    }
}

/// Wet snow with carbon in ice and pores.
pub(crate) fn dirty() -> Snow {
    Snow {
        black_carbon: Some(Carbon {
            sedimentation: 0.4,
            ..Carbon::black(800.0)
        }),
        brown_carbon: Some(Carbon {
            sedimentation: 0.7,
            ..Carbon::brown(500.0)
        }),
        ..snow((300.0, 750.0), 0.3, 275.0, 0.1)
    }
}

pub(crate) fn on_substrate(snow: Snow, substrate: Substrate) -> Snowpack {
    Snowpack {
        substrate,
        ..snow.into()
    }
}

/// Snow on another layer, `below_m` thick.
pub(crate) fn two_layers(surface: Snow, below: Snow, below_m: f64) -> Snowpack {
    Snowpack {
        surface,
        below: vec![Layer {
            snow: below,
            thickness_m: below_m,
        }],
        substrate: Substrate::Black,
    }
}

/// A substrate whose reflectance depends on wavelength.
pub(crate) fn spectral_substrate() -> Substrate {
    let text = "wavelength_nm,reflectance\n400,0.1\n800,0.9\n1300,0.3\n";
    Substrate::Spectrum {
        table: Table::parse("g", text, &["wavelength_nm", "reflectance"]).unwrap(),
    }
}
