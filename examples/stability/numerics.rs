//! Extreme cases of the plane-parallel solver, the decomposition and the colour
//! difference.
use ndarray::Array2;
use splitsnow::colour::{Colorimeter, delta_e};
use splitsnow::compress::{Bands, Basis, CurveModel, Decomposition, Precision};
use splitsnow::measurement::Quantity;
use splitsnow::slab::{Light, Medium, Streams};

/// Result of one check.
pub(crate) struct Check {
    /// The case.
    pub(crate) what: String,
    /// The result, in words and numbers.
    pub(crate) found: String,
    /// Whether the result is correct.
    pub(crate) holds: bool,
}

fn check(what: impl Into<String>, found: String, holds: bool) -> Check {
    Check {
        what: what.into(),
        found,
        holds,
    }
}

pub(crate) fn solver() -> Vec<Check> {
    let mut checks = vec![];
    let depths = [1e-3, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5];
    let lights = [
        Light::Collimated { cosine: 1.0 },
        Light::Collimated { cosine: 1.745e-4 },
        Light::Diffuse,
    ];
    for g in [0.0, 0.85] {
        for albedo in [1.0, 1.0 - 1e-12, 1.0 - 1e-6, 0.99, 0.5, 1e-9, 0.0] {
            let streams = Streams::new(8).unwrap();
            let chi: Vec<f64> = (0..17).map(|l| albedo * f64::powi(g, l)).collect();
            let medium = Medium::delta_m(&streams, &chi).unwrap();
            let (mut possible, mut leak, mut least): (bool, f64, f64) = (true, 0.0, 1.0);
            for light in lights {
                let mut previous: Option<(f64, f64)> = None;
                for depth in depths {
                    let f = medium.fluxes(depth, light).unwrap();
                    let (r, t) = (f.reflectance, f.transmittance);
                    possible &= r.is_finite() && t.is_finite();
                    possible &= r > -1e-12 && t > -1e-12 && r + t < 1.0 + 1e-11;
                    possible &= previous.is_none_or(|(r0, t0)| r >= r0 - 1e-11 && t <= t0 + 1e-11);
                    previous = Some((r, t));
                    if albedo == 1.0 {
                        leak = leak.max((r + t - 1.0).abs());
                    }
                    least = least.min(t);
                }
            }
            let found = if albedo == 1.0 {
                format!("energy to {leak:.0e}, least T {least:.1e}")
            } else {
                format!("least T {least:.1e}")
            };
            let what = format!("albedo 1 - {:.0e}, g {g}, depth 1e-3 to 1e5", 1.0 - albedo);
            checks.push(check(what, found, possible && leak < 1e-11));
        }
    }
    // below 1e-30 T still falls by the same factor per depth
    let streams = Streams::new(8).unwrap();
    let medium = Medium::new(&streams, &[0.9]).unwrap();
    let t = |depth| medium.fluxes(depth, Light::Diffuse).unwrap().transmittance;
    let (near, far) = (t(41.0) / t(40.0), t(601.0) / t(600.0));
    let found = format!(
        "T {:.1e} at depth 600; ratios agree to {:.0e}",
        t(600.0),
        near / far - 1.0
    );
    checks.push(check(
        "T below 1e-30, albedo 0.9",
        found,
        t(600.0) < 1e-30 && (near / far - 1.0).abs() < 1e-9,
    ));
    checks
}

/// Matrices of curves by wavelengths, with their names.
pub(crate) fn matrices() -> Vec<(&'static str, Array2<f64>)> {
    let orthogonal = Array2::from_shape_fn((31, 31), |(i, j)| {
        // a reflection: all singular values are 1
        f64::from(u8::from(i == j)) - 2.0 / 31.0
    });
    vec![
        (
            "rank one",
            Array2::from_shape_fn((200, 31), |(i, j)| {
                0.004 * i as f64 * (0.01 * j as f64).exp()
            }),
        ),
        ("all zero", Array2::zeros((200, 31))),
        ("equal singular values", orthogonal),
        (
            "one row",
            Array2::from_shape_fn((1, 31), |(_, j)| 0.5 + 0.01 * j as f64),
        ),
        (
            "one wavelength",
            Array2::from_shape_fn((50, 1), |(i, _)| 0.01 * i as f64),
        ),
        (
            "fewer rows than wavelengths",
            Array2::from_shape_fn((5, 31), |(i, j)| ((7 * i + j) as f64).sin().abs()),
        ),
        (
            "from 1e-300 to 1",
            Array2::from_shape_fn((300, 31), |(i, j)| {
                10_f64.powf(-(i as f64)) * (1.0 - 0.01 * j as f64)
            }),
        ),
    ]
}

pub(crate) fn decomposition() -> Vec<Check> {
    let visible: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
    let colour = Colorimeter::new(&visible).unwrap().unwrap();
    matrices()
        .into_iter()
        .map(|(what, m)| {
            let decomposed = Decomposition::new(m.view()).unwrap();
            let basis = &decomposed.basis;
            let gram = basis.t().dot(basis) - Array2::<f64>::eye(decomposed.rank_limit());
            let largest = |a: &Array2<f64>| a.iter().fold(0.0_f64, |x, y| x.max(y.abs()));
            let rebuilt = m.dot(basis).dot(&basis.t());
            let colour = (m.ncols() == 31).then_some(&colour);
            let quantity = Quantity::Transmittance;
            let bands = Bands::default();
            let model = CurveModel::new(m.view(), quantity, colour, &bands, Basis::Linear).unwrap();
            let table = model.table(decomposed.rank_limit(), Precision::F32);
            let table = table.unwrap();
            let last = &table.rows[table.rows.len() - 1];
            let (gram, residual) = (largest(&gram), largest(&(&rebuilt - &m)));
            // limits: rounding of sums of 31 terms; and f32 in the table, with a Delta-E of at
            // most 900 per unit
            let holds = gram < 1e-13
                && residual < 1e-13
                && last.rmse.max < 1e-6
                && last.delta_e.is_none_or(|e| e.max < 1e-3);
            let found = format!(
                "basis orthonormal to {gram:.0e}, rebuilt to {residual:.0e}, in f32 RMSE {:.0e}",
                last.rmse.max
            );
            check(what, found, holds)
        })
        .collect()
}

pub(crate) fn colours() -> Vec<Check> {
    let visible: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
    let colour = Colorimeter::new(&visible).unwrap().unwrap();
    let delta_e_of = |a: f64, b: f64| delta_e(colour.lab(&[a; 31]), colour.lab(&[b; 31]));
    // L* = 903.3 Y below Y = 0.008856, steeper than anywhere above
    let slope = 24389.0 / 27.0;
    let mut checks: Vec<Check> = [
        (0.0, 0.0),
        (0.0, 1e-300),
        (0.0, 1e-30),
        (0.0, 1e-4),
        (1e-4, 2e-4),
        (1e-3, 0.0),
    ]
    .into_iter()
    .map(|(a, b)| {
        let e = delta_e_of(a, b);
        let expected = slope * (a - b).abs();
        // rounding: L* is a difference of numbers of about 16
        let holds = e.is_finite() && (e - expected).abs() < 1e-12;
        check(
            format!("greys {a:.0e} and {b:.0e}"),
            format!("Delta-E {e:.3e}"),
            holds,
        )
    })
    .collect();
    let e = delta_e_of(0.0, -1e-6);
    checks.push(check(
        "black and -1e-6",
        format!("Delta-E {e:.3e}"),
        (e - slope * 1e-6).abs() < 1e-12,
    ));
    let below = 216.0 / 24389.0 * (1.0 - 1e-12);
    let e = delta_e_of(below, below * (1.0 + 2e-12));
    checks.push(check(
        "either side of Y = 0.008856",
        format!("Delta-E {e:.1e}"),
        e < 1e-9,
    ));
    checks
}
