//! Test cases at the limits of the parameter space and beyond, and how they are run.
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::{Cache, Control, Engine, EngineError, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Carbon;
use splitsnow::transport::{
    Component, Entry, Illumination, Joining, Layer, Model, Snow, Snowpack, Substrate,
};

/// Minimum, maximum, mean and standard deviation of a truncated normal law.
pub(crate) type Law = [f64; 4];
/// Facetness and sphericity of the representative sample (Varsa 2025, chapter 7).
pub(crate) const FACETNESS: Law = [0.2, 0.4, 0.3, 0.072];
pub(crate) const SPHERICITY: Law = [0.6, 0.95, 0.798, 0.064];
/// Incidence angle that stands for diffuse light.
pub(crate) const DIFFUSE: f64 = f64::NAN;

/// A snowpack with its illumination, thicknesses and wavelengths.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) snowpack: Snowpack,
    pub(crate) model: Model,
    pub(crate) light: Illumination,
    pub(crate) thicknesses_m: Vec<f64>,
    pub(crate) wavelengths_nm: Vec<f64>,
}

/// Dry snow at -1 C with grains of `size_um`.
pub(crate) fn snow(size_um: [f64; 2], facetness: Law, sphericity: Law, density_kg_m3: f64) -> Snow {
    let law = |l: Law| TruncatedNormal::new(l[0], l[1], l[2], l[3]).unwrap();
    Snow::dry(
        GrainType {
            size: SizeRange::new(size_um[0] * 1e-6, size_um[1] * 1e-6).unwrap(),
            facetness: law(facetness),
            shape: Shape::Spheroid,
            proportion: law(sphericity),
        },
        density_kg_m3,
        -1.0,
    )
}

/// The representative sample, dry.
pub(crate) fn ordinary() -> Snow {
    snow([300.0, 750.0], FACETNESS, SPHERICITY, 275.0)
}

pub(crate) fn wet(snow: Snow, water_saturation: f64) -> Snow {
    Snow {
        water_saturation,
        ..snow
    }
}

pub(crate) fn light(degrees: f64) -> Illumination {
    if degrees.is_nan() {
        return Illumination::Diffuse;
    }
    Illumination::Collimated {
        polar_angle_rad: degrees.to_radians(),
    }
}

impl Case {
    /// A case with surface layers of the thicknesses `depths`, in mean free distances.
    pub(crate) fn new(
        name: &str,
        snowpack: impl Into<Snowpack>,
        degrees: f64,
        depths: &[f64],
        nm: &[f64],
    ) -> Self {
        let snowpack = snowpack.into();
        let (distance_m, below_m) = (snowpack.surface.mean_free_distance_m(), snowpack.below_m());
        Self {
            name: name.into(),
            snowpack,
            model: Model::default(),
            light: light(degrees),
            thicknesses_m: depths.iter().map(|d| below_m + d * distance_m).collect(),
            wavelengths_nm: nm.to_vec(),
        }
    }

    /// The case with the thicknesses `grains`, in lengths of the largest grain.
    pub(crate) fn in_grains(mut self, grains: &[f64]) -> Self {
        let size_m = self.snowpack.surface.sizes_m()[1];
        self.thicknesses_m = grains.iter().map(|g| g * size_m).collect();
        self
    }

    /// Thickness of the surface layer of a snowpack `thickness_m` thick, in mean free
    /// distances.
    pub(crate) fn depth(&self, thickness_m: f64) -> f64 {
        (thickness_m - self.snowpack.below_m()) / self.snowpack.surface.mean_free_distance_m()
    }

    /// The case with its layers as a cascade of separate slabs.
    pub(crate) fn cascaded(mut self) -> Self {
        self.model.joining = Joining::Cascade;
        self
    }

    /// The case with projected entry: rays enter grains as if the grains were placed at
    /// random.
    pub(crate) fn projected(mut self) -> Self {
        self.model.entry = Entry::Projected;
        self
    }

    /// Runs `engine` without the check of its range of validity: one spectrum per
    /// thickness.
    pub(crate) fn run(
        &self,
        engine: Engine,
        rays: u64,
        resolution: Resolution,
        cache: &Cache,
        seed: u64,
    ) -> Result<Vec<Spectrum>, EngineError> {
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m: &self.thicknesses_m,
            illuminations: &[self.light],
            wavelengths_nm: &self.wavelengths_nm,
            model: &self.model,
            rays,
            resolution,
            max_error: MaxError::default(),
            seed,
            cell: 0,
        };
        let control = Control {
            parallel: true,
            cancel: &AtomicBool::new(false),
            rays_done: &AtomicU64::new(0),
            cache,
        };
        engine.run_unchecked(&request, &control)
    }

    /// The error with which the engine refuses the case; `None` if it accepts it.
    pub(crate) fn refusal(&self, engine: Engine, resolution: Resolution) -> Option<EngineError> {
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m: &self.thicknesses_m,
            illuminations: &[self.light],
            wavelengths_nm: &self.wavelengths_nm,
            model: &self.model,
            rays: 1,
            resolution,
            max_error: MaxError::default(),
            seed: 0,
            cell: 0,
        };
        engine.check(&request).err()
    }
}

/// Difference of two independent values, in joint standard errors.
pub(crate) fn z(a: Measured, b: Measured) -> f64 {
    let se = a.se.hypot(b.se);
    if se > 0.0 {
        (a.value - b.value) / se
    } else if a.value == b.value {
        0.0
    } else {
        f64::INFINITY
    }
}

/// Snow with fine faceted grains.
pub(crate) fn fresh() -> Snow {
    snow([50.0, 100.0], [0.7, 0.99, 0.9, 0.5], SPHERICITY, 225.0)
}

/// Snow with coarse rounded grains.
pub(crate) fn coarse() -> Snow {
    snow([900.0, 1000.0], [0.05, 0.15, 0.1, 0.075], SPHERICITY, 375.0)
}

/// A snowpack with the layer `surface` over the layers `below`, given from the surface
/// down with their thicknesses in cm.
pub(crate) fn over(surface: Snow, below: &[(Snow, f64)], substrate: Substrate) -> Snowpack {
    let layer = |(snow, cm): &(Snow, f64)| Layer {
        snow: snow.clone(),
        thickness_m: cm * 1e-2,
    };
    Snowpack {
        surface,
        below: below.iter().map(layer).collect(),
        substrate,
    }
}

/// `snow` with black carbon: its concentration in ng/g and the share of it in the ice.
fn sooty(snow: Snow, concentration_ng_g: f64, sedimentation: f64) -> Snow {
    let carbon = Carbon {
        sedimentation,
        ..Carbon::black(concentration_ng_g)
    };
    Snow {
        black_carbon: Some(carbon),
        ..snow
    }
}

/// Cases with several layers, several grain types, carbon or a bright substrate.
fn snowpacks() -> Vec<Case> {
    let nm = &[400.0, 700.0, 1030.0, 1300.0, 2000.0];
    let slabs = &[2.5, 5.0, 12.0, 30.0];
    let case = |name: &str, snowpack: Snowpack| Case::new(name, snowpack, 0.0, slabs, nm);
    let black = || Substrate::Black;
    let mixture = |a: Snow, b: Snow, share: f64| {
        let component = |snow: &Snow, fraction| Component {
            fraction,
            grain: snow.grains[0].grain,
        };
        Snow {
            grains: vec![component(&a, share), component(&b, 1.0 - share)],
            ..ordinary()
        }
    };
    vec![
        case(
            "fresh on coarse",
            over(fresh(), &[(coarse(), 1.0)], black()),
        ),
        case(
            "coarse on fresh",
            over(coarse(), &[(fresh(), 1.0)], black()),
        ),
        case(
            "half a grain of coarse in fresh",
            over(fresh(), &[(coarse(), 0.05), (fresh(), 0.2)], black()),
        ),
        case(
            "a hundredth of a grain",
            over(ordinary(), &[(coarse(), 0.001), (ordinary(), 0.5)], black()),
        ),
        case(
            "ten layers of one grain",
            over(fresh(), &vec![(ordinary(), 0.075); 10], black()),
        ),
        case(
            "fresh on coarse, cascade",
            over(fresh(), &[(coarse(), 1.0)], black()),
        )
        .cascaded(),
        case(
            "mixture, fresh and coarse",
            mixture(fresh(), coarse(), 0.5).into(),
        ),
        case(
            "mixture, 1 % fresh",
            mixture(fresh(), coarse(), 0.01).into(),
        ),
        case("substrate 0.5", over(ordinary(), &[], Substrate::Grey(0.5))),
        case("substrate 1", over(ordinary(), &[], Substrate::Grey(1.0))),
        case("1000 ng/g in the ice", sooty(ordinary(), 1e3, 1.0).into()),
        case("1e5 ng/g in the ice", sooty(ordinary(), 1e5, 1.0).into()),
        case("1000 ng/g in the pores", sooty(ordinary(), 1e3, 0.0).into()),
        case("1e5 ng/g in the pores", sooty(ordinary(), 1e5, 0.0).into()),
        case(
            "1e5 ng/g in pores half full",
            sooty(wet(ordinary(), 0.5), 1e5, 0.5).into(),
        ),
    ]
}

/// Every case of the map.
pub(crate) fn all() -> Vec<Case> {
    let mut cases = homogeneous();
    cases.extend(snowpacks());
    cases
}

fn homogeneous() -> Vec<Case> {
    let visible_to_infrared = &[400.0, 700.0, 1030.0, 1300.0, 2000.0];
    let slabs = &[2.5, 5.0, 12.0, 30.0];
    let case = |name: &str, snow: Snow, degrees: f64| {
        Case::new(name, snow, degrees, slabs, visible_to_infrared)
    };
    let constant = |x: f64| [x, x, x, 0.0];
    // scaling all lengths by `factor` scales the absorption by it: at 390 nm the ice then
    // absorbs as with k = 2e-11 `factor`
    let scaled = |name: &str, factor: f64, nm: f64| {
        let snow = snow(
            [300.0 * factor, 750.0 * factor],
            FACETNESS,
            SPHERICITY,
            275.0,
        );
        Case::new(name, snow, 0.0, &[2.5, 5.0, 12.0, 30.0, 100.0], &[nm])
    };
    let shape = |size, facetness, sphericity| snow(size, facetness, sphericity, 275.0);
    let size = [300.0, 750.0];
    vec![
        case("ordinary", ordinary(), 0.0),
        scaled("no absorption", 1e-9, 390.0),
        scaled("k = 1e-12", 0.05, 390.0),
        scaled("k = 0.1", 0.1 / 1.64e-3, 2000.0),
        Case::new(
            "depth 1e-3 to 1",
            Snow {
                density_kg_m3: 0.1,
                ..ordinary()
            },
            0.0,
            &[1e-3, 1e-2, 0.1, 1.0],
            visible_to_infrared,
        ),
        Case::new(
            "depth 100 to 1000",
            ordinary(),
            0.0,
            &[100.0, 300.0, 1000.0],
            &[400.0, 1030.0],
        ),
        case("60 degrees", ordinary(), 60.0),
        case("85 degrees", ordinary(), 85.0),
        case("89 degrees", ordinary(), 89.0),
        case("89.9 degrees", ordinary(), 89.9),
        case("89.99 degrees", ordinary(), 89.99),
        case("diffuse", ordinary(), DIFFUSE),
        case("projected entry", ordinary(), 50.0).projected(),
        case(
            "spheres in slabs of 0.99 grains",
            shape([500.0; 2], FACETNESS, constant(1.0)),
            0.0,
        )
        .in_grains(&[0.99]),
        case("slabs of 1.02 to 8 grains", ordinary(), 0.0)
            .in_grains(&[1.02, 1.5, 3.0, 3.5, 3.7, 4.0, 8.0]),
        case(
            "one grain size",
            shape([500.0; 2], FACETNESS, SPHERICITY),
            0.0,
        ),
        case(
            "50-3000 um",
            shape([50.0, 3000.0], FACETNESS, SPHERICITY),
            0.0,
        )
        .in_grains(&[1.5, 3.5, 4.0, 8.0]),
        case("facetness 0", shape(size, constant(0.0), SPHERICITY), 0.0),
        case("facetness 1", shape(size, constant(1.0), SPHERICITY), 0.0),
        case(
            "sphericity 0.05",
            shape(size, FACETNESS, constant(0.05)),
            0.0,
        )
        .in_grains(&[1.5, 3.5, 4.0, 8.0]),
        case("sphericity 0.3", shape(size, FACETNESS, constant(0.3)), 0.0)
            .in_grains(&[1.5, 3.5, 4.0, 8.0]),
        case("sphericity 1", shape(size, FACETNESS, constant(1.0)), 0.0),
        case(
            "smooth spheres",
            shape([500.0; 2], constant(0.0), constant(1.0)),
            0.0,
        ),
        case(
            "density 1",
            Snow {
                density_kg_m3: 1.0,
                ..ordinary()
            },
            0.0,
        ),
        case(
            "density 549",
            Snow {
                density_kg_m3: 549.0,
                ..ordinary()
            },
            0.0,
        ),
        case(
            "density 549, 89 degrees",
            Snow {
                density_kg_m3: 549.0,
                ..ordinary()
            },
            89.0,
        ),
        case("saturation 0.1", wet(ordinary(), 0.1), 0.0),
        case("saturation 0.5", wet(ordinary(), 0.5), 0.0),
        case("saturation 1", wet(ordinary(), 1.0), 0.0),
    ]
}

/// One snow at one wavelength, with all lengths scaled so that the ice absorbs as if its
/// imaginary index were `k`. Geometry, refractive index and random numbers stay the same.
pub(crate) fn absorbing(k: f64, saturation: f64) -> Case {
    let factor = k / 1.32e-5;
    let scaled = snow(
        [300.0 * factor, 750.0 * factor],
        FACETNESS,
        SPHERICITY,
        275.0,
    );
    let depths = [2.0, 4.2, 6.0, 12.0, 30.0];
    let name = format!("k = {k:.0e}, saturation {saturation}");
    Case::new(&name, wet(scaled, saturation), 0.0, &depths, &[1300.0])
}
