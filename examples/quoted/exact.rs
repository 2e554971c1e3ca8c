//! Numbers quoted in the documentation that are computed without random numbers.
use std::f64::consts::FRAC_PI_2;

use splitsnow::colour::{Colorimeter, delta_e};
use splitsnow::grain::{
    Shape, SizeLaw, SizeRange, TruncatedNormal, mean_free_distance_m, overpacking, shape_factor,
    size_factor_per_m,
};
use splitsnow::transport::FIRST_FLIGHT;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::cases::{FACETNESS, SPHERICITY, ordinary, snow};
use super::row::Quoted;

/// Computes all numbers, in milliseconds.
pub(crate) fn exact() -> Vec<Quoted> {
    let mut rows = vec![];
    let mut add = |name: &str, value: f64, setting: &str| {
        rows.push(Quoted::new(name, value, 0.0, setting));
    };
    let sizes = |min: f64, max: f64| SizeRange::new(min * 1e-6, max * 1e-6).unwrap();
    let usual = sizes(300.0, 750.0);
    let per_m = size_factor_per_m(&usual);
    add("K1 varsa2025", per_m, "300-750 um, 1/m");
    let per_m = size_factor_per_m(&usual.with_law(SizeLaw::Consistent));
    add("K1 consistent", per_m, "300-750 um, 1/m");
    for (min, max) in [(300.0, 750.0), (150.0, 800.0), (50.0, 3000.0)] {
        let times = overpacking(&sizes(min, max));
        add(
            "ice met",
            times,
            &format!("{min}-{max} um, times the volume fraction"),
        );
    }
    let [min, max, mean, sd] = SPHERICITY;
    let psi = TruncatedNormal::new(min, max, mean, sd).unwrap();
    let [published, consistent] = [SizeLaw::Varsa2025, SizeLaw::Consistent]
        .map(|law| shape_factor(Shape::Spheroid, &psi, law));
    add(
        "ice met for shapes",
        100.0 * (published / consistent - 1.0),
        "more, %",
    );
    add(
        "optical radius",
        0.75 / published,
        "of the length of grains of one size",
    );
    let grain = ordinary().grains[0].grain;
    let distance_m = mean_free_distance_m(&grain, 450.0, -1.0);
    add(
        "mean free distance",
        distance_m,
        "representative sample at 450 kg/m3, m",
    );
    // probability that the root mean square over ten independent wavelengths exceeds two
    // standard errors
    let chi = ChiSquared::new(10.0).unwrap();
    add(
        "noise above two errors",
        1e5 * chi.sf(40.0),
        "of 100,000 curves",
    );

    // forward scattering in one dimension: the decay rate v solves 1 - v d = w exp(v s)
    let (d, s) = (1.0, 0.4);
    for w in [0.9, 0.5, 0.1] {
        let (mut low, mut high) = (0.0, 1.0 / d);
        for _ in 0..100 {
            let v = 0.5 * (low + high);
            let is_below = 1.0 - v * d > w * f64::exp(v * s);
            (low, high) = if is_below { (v, high) } else { (low, v) };
        }
        let setting = format!("{w} survive an event, displacement 0.4 d");
        add("free path that decays right", (1.0 - w) / low, &setting);
        add("free path of the rule", d + w * s, &setting);
    }
    let needles = snow([300.0, 750.0], FACETNESS, [0.05, 0.05, 0.05, 0.0], 275.0);
    for (name, snow) in [("ordinary", ordinary()), ("needles", needles)] {
        let cosine = FIRST_FLIGHT * snow.sizes_m()[1] / snow.mean_free_distance_m();
        let degrees = (FRAC_PI_2 - cosine.asin()).to_degrees();
        add("most grazing light", degrees, &format!("{name}, degrees"));
    }
    let cosine = FIRST_FLIGHT * ordinary().sizes_m()[1] / ordinary().mean_free_distance_m();
    add(
        "isotropic light beyond the limit",
        cosine * cosine,
        "of all",
    );

    let visible: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
    let colour = Colorimeter::new(&visible).unwrap().unwrap();
    let dark = |t: f64| delta_e(colour.lab(&[0.0; 31]), colour.lab(&[t; 31]));
    add("Delta-E near black", dark(1e-3) / 1e-3, "per unit");
    add("Delta-E of .0025", dark(2.5e-3), "at black");
    rows
}
