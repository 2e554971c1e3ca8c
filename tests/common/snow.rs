//! Snow samples, walks and statistical limits for the physics tests.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::math::Vec3;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Index;
use splitsnow::rng::{Key, Stream};
use splitsnow::transport::{
    Absorption, Coefficients, End, Entry, Illumination, Model, Path, Sink, Snow, TRACERS, Walk,
    Walker,
};
use statrs::function::erf::erfc_inv;

pub(crate) const NORMAL: Illumination = Illumination::Collimated {
    polar_angle_rad: 0.0,
};
pub(crate) const TRANSPARENT: Absorption = Absorption {
    coefficients: Coefficients {
        ice_per_m: 0.0,
        water_per_m: 0.0,
        impurities: [0.0; TRACERS],
    },
    deferred: 0.0,
};
pub(crate) const AIR: Index = Index { n: 1.0, k: 0.0 };

/// A beam at `deg` degrees from the normal.
pub(crate) fn beam(deg: f64) -> Illumination {
    Illumination::Collimated {
        polar_angle_rad: deg.to_radians(),
    }
}

/// The random number stream of the test with number `cell`.
pub(crate) fn stream(cell: u64) -> Stream {
    Stream::new(Key {
        seed: 2025,
        cell,
        purpose: [9, 9, 9],
        batch: 0,
    })
}

/// The representative sample (Varsa 2025, chapter 7) with another size range, mean
/// facetness (half width 0.1), density and water saturation.
pub(crate) fn snow(size_um: (f64, f64), facetness: f64, density_kg_m3: f64, wet: f64) -> Snow {
    Snow {
        water_saturation: wet,
        ..Snow::dry(
            GrainType {
                size: SizeRange::new(size_um.0 * 1e-6, size_um.1 * 1e-6).unwrap(),
                facetness: TruncatedNormal::new(facetness - 0.1, facetness + 0.1, facetness, 0.072)
                    .unwrap(),
                shape: Shape::Spheroid,
                proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
            },
            density_kg_m3,
            -1.0,
        )
    }
}

/// The representative sample without liquid water.
pub(crate) fn dry() -> Snow {
    snow((300.0, 750.0), 0.3, 275.0, 0.0)
}

/// Snow of smooth spheres of one size.
pub(crate) fn spheres(size_um: f64, density_kg_m3: f64) -> Snow {
    let constant = |value| TruncatedNormal::new(value, value, value, 0.0).unwrap();
    let grain = GrainType {
        size: SizeRange::new(size_um * 1e-6, size_um * 1e-6).unwrap(),
        facetness: constant(0.0),
        shape: Shape::Spheroid,
        proportion: constant(1.0),
    };
    Snow::dry(grain, density_kg_m3, -1.0)
}

/// A walker through grains of real refractive index `n` in air.
pub(crate) fn walker(snow: &Snow, entry: Entry, n: f64, absorption: Absorption) -> Walker {
    let model = Model {
        entry,
        ..Model::default()
    };
    model_walker(snow, &model, n, absorption)
}

/// As [`walker`], with other model options.
pub(crate) fn model_walker(snow: &Snow, model: &Model, n: f64, absorption: Absorption) -> Walker {
    let index = Index { n, k: 0.0 };
    Walker::new(&snow.clone().into(), model, (index, AIR), absorption)
}

/// Counts of how walks in one slab end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Ends {
    pub(crate) reflected: u64,
    pub(crate) transmitted: u64,
    pub(crate) absorbed: u64,
    pub(crate) lost: u64,
}

impl Ends {
    pub(crate) fn add(&mut self, end: End) {
        match end {
            End::Reflected => self.reflected += 1,
            End::Transmitted => self.transmitted += 1,
            End::Absorbed => self.absorbed += 1,
            End::Lost => self.lost += 1,
        }
    }
}

/// A sink for a single slab that calls a function at the end of every walk.
pub(crate) struct Each<F>(pub(crate) F);

impl<F: FnMut(End, &Path, Vec3)> Sink for Each<F> {
    fn end(&mut self, _: Range<usize>, end: End, path: &Path, direction: Vec3) {
        self.0(end, path, direction);
    }
}

/// Walks `rays` rays through one slab and counts how they end.
pub(crate) fn ends(
    walker: &Walker,
    thickness_m: f64,
    light: Illumination,
    rays: u64,
    cell: u64,
) -> Ends {
    let mut counts = Ends::default();
    let mut sink = Each(|end, _: &Path, _| counts.add(end));
    walker
        .walk(&[thickness_m], light, rays, stream(cell), &mut sink)
        .unwrap();
    counts
}

/// The fraction `count / rays` with its binomial standard error.
pub(crate) fn proportion(count: u64, rays: u64) -> Measured {
    let (n, value) = (rays as f64, count as f64 / rays as f64);
    let se = (value * (1.0 - value) / n).sqrt().max(1.0 / n);
    Measured { value, se }
}

/// Spectra of dry or wet `snow`, one per thickness, by the engine `tabulated`. It costs a
/// tenth of `spectral`. tests/engines.rs and tests/golden.rs compare the two.
pub(crate) fn spectra(
    snow: &Snow,
    thicknesses_m: &[f64],
    illumination: Illumination,
    wavelengths_nm: &[f64],
    rays: u64,
) -> Vec<Spectrum> {
    let request = Request {
        snowpack: &snow.clone().into(),
        thicknesses_m,
        illuminations: &[illumination],
        resolution: Resolution::for_rays(rays),
        max_error: MaxError::default(),
        wavelengths_nm,
        model: &Model::default(),
        rays,
        seed: 2025,
        cell: 0,
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    Engine::Tabulated.run(&request, &control).unwrap()
}

/// The limit on |z| for `comparisons` z-tests at total significance level `alpha`
/// (two-sided, Bonferroni). All stay below it with probability 1 - `alpha` or more.
pub(crate) fn z_limit(alpha: f64, comparisons: usize) -> f64 {
    std::f64::consts::SQRT_2 * erfc_inv(alpha / comparisons as f64)
}
