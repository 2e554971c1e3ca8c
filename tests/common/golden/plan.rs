//! The cases of the golden data and the number of rays for each.

use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::transport::{Illumination, Snow};
use splitsnow::units::um_to_m;

/// The snow parameters of one row of the file. Facetness is truncated to mean
/// -+ half width and to [0, 1] and has standard deviation 0.072. Sphericity
/// and temperature are those of `configs/thesis.toml`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GoldenSnow {
    /// Shortest and longest grain, um.
    pub(crate) size_um: [f64; 2],
    /// Mean and half width.
    pub(crate) facetness: [f64; 2],
    /// Density without liquid water.
    pub(crate) density_kg_m3: f64,
    /// Fraction of the pore space filled with water.
    pub(crate) saturation: f64,
}

impl GoldenSnow {
    pub(crate) fn snow(&self) -> Snow {
        let [mean, half_width] = self.facetness;
        let (min, max) = ((mean - half_width).max(0.0), (mean + half_width).min(1.0));
        let [size_min_um, size_max_um] = self.size_um;
        Snow {
            water_saturation: self.saturation,
            ..Snow::dry(
                GrainType {
                    size: SizeRange::new(um_to_m(size_min_um), um_to_m(size_max_um)).unwrap(),
                    facetness: TruncatedNormal::new(min, max, mean, 0.072).unwrap(),
                    shape: Shape::Spheroid,
                    proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
                },
                self.density_kg_m3,
                -1.0,
            )
        }
    }
}

/// Incidence angle in degrees. `None` is diffuse light.
pub(crate) type AngleDeg = Option<f64>;

pub(crate) fn illumination(angle_deg: AngleDeg) -> Illumination {
    angle_deg.map_or(Illumination::Diffuse, |deg| Illumination::Collimated {
        polar_angle_rad: deg.to_radians(),
    })
}

/// Groups of wavelengths that share walks, nm. The near infrared has two
/// groups because strong absorption makes walks in the second much cheaper.
pub(crate) const BANDS: [&[f64]; 3] = [
    &[
        400.0, 410.0, 420.0, 430.0, 440.0, 450.0, 460.0, 470.0, 480.0, 490.0, 500.0, 510.0, 520.0,
        530.0, 540.0, 550.0, 560.0, 570.0, 580.0, 590.0, 600.0, 610.0, 620.0, 630.0, 640.0, 650.0,
        660.0, 670.0, 680.0, 690.0, 700.0,
    ],
    &[800.0, 900.0],
    &[1030.0, 1250.0, 1400.0],
];

/// Slabs that share their walks, at the wavelengths of one band.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) snow: GoldenSnow,
    pub(crate) angle_deg: AngleDeg,
    pub(crate) thicknesses_cm: Vec<f64>,
    pub(crate) wavelengths_nm: &'static [f64],
    /// Walks per index node.
    pub(crate) rays: u64,
}

/// One snow under one illumination.
struct Pair {
    snow: GoldenSnow,
    angle_deg: AngleDeg,
    /// Thicknesses, cm, that share their walks in the visible, and the number
    /// of rays in thousands. Thin slabs are cheap and noisy; thick slabs are
    /// expensive and precise.
    visible: &'static [(&'static [f64], u64)],
    /// Number of rays in thousands in each of the two other bands, where all
    /// thicknesses share their walks.
    infrared: [u64; 2],
}

/// All runs, in the order of the file.
pub(crate) fn runs() -> Vec<Run> {
    PLAN.iter().flat_map(Pair::runs).collect()
}

impl Pair {
    fn runs(&self) -> Vec<Run> {
        let run = |thicknesses_cm, band: usize, kilorays| Run {
            snow: self.snow,
            angle_deg: self.angle_deg,
            thicknesses_cm,
            wavelengths_nm: BANDS[band],
            rays: 1000 * kilorays,
        };
        let visible = self.visible.iter();
        let thicknesses_cm: Vec<f64> = visible.clone().flat_map(|(cm, _)| cm.to_vec()).collect();
        visible
            .map(|(cm, kilorays)| run(cm.to_vec(), 0, *kilorays))
            .chain([1, 2].map(|band| run(thicknesses_cm.clone(), band, self.infrared[band - 1])))
            .collect()
    }
}

/// A node of the grid of `configs/thesis.toml`.
const fn grid(facetness: f64, size_um: f64, density_kg_m3: f64) -> GoldenSnow {
    let size_um = [size_um - 50.0, size_um + 50.0];
    golden_snow(size_um, [facetness, 0.1], density_kg_m3, 0.0)
}

/// A snow with the sphericity and temperature of `configs/thesis.toml`.
const fn golden_snow(
    size_um: [f64; 2],
    facetness: [f64; 2],
    density_kg_m3: f64,
    saturation: f64,
) -> GoldenSnow {
    GoldenSnow {
        size_um,
        facetness,
        density_kg_m3,
        saturation,
    }
}

const fn pair(
    snow: GoldenSnow,
    angle_deg: AngleDeg,
    visible: &'static [(&'static [f64], u64)],
    infrared: [u64; 2],
) -> Pair {
    Pair {
        snow,
        angle_deg,
        visible,
        infrared,
    }
}

const NORMAL: AngleDeg = Some(0.0);
const DIFFUSE: AngleDeg = None;
/// The sample of `configs/samples/representative.toml`.
const WET: GoldenSnow = golden_snow([300.0, 750.0], [0.3, 0.1], 275.0, 0.05);
/// `WET` without its water.
const DRY: GoldenSnow = golden_snow([300.0, 750.0], [0.3, 0.1], 275.0, 0.0);
const FINE: GoldenSnow = golden_snow([50.0, 150.0], [0.3, 0.1], 400.0, 0.0);
const COARSE: GoldenSnow = golden_snow([1000.0, 2000.0], [0.3, 0.1], 300.0, 0.0);
const BROAD: GoldenSnow = golden_snow([50.0, 3000.0], [0.3, 0.1], 300.0, 0.0);
const SMOOTH: GoldenSnow = golden_snow([200.0, 300.0], [0.0, 0.0], 300.0, 0.0);
const ROUGH: GoldenSnow = golden_snow([200.0, 300.0], [1.0, 0.0], 300.0, 0.0);

/// The index of a run is its cell number (see [`splitsnow::rng::Key`]): append new pairs at
/// the end only.
#[rustfmt::skip]
const PLAN: &[Pair] = &[
    // all corners of facetness, grain size and density
    pair(grid(0.1, 100.0, 200.0), NORMAL,     &[(&[1.0], 1400), (&[3.0],  515), (&[10.0], 150), (&[50.0],  20)], [360, 500]),
    pair(grid(0.9, 100.0, 200.0), Some(60.0), &[(&[1.0],  760), (&[3.0],  500), (&[7.0],  240), (&[50.0],  20)], [220, 480]),
    pair(grid(0.1, 100.0, 400.0), Some(89.0), &[(&[1.0],  460), (&[3.0],  650), (&[10.0],  80), (&[50.0],  20)], [200, 450]),
    pair(grid(0.9, 100.0, 400.0), NORMAL,     &[(&[1.0],  600), (&[3.0],  400), (&[15.0],  40), (&[50.0],  14)], [220, 500]),
    pair(grid(0.1, 500.0, 200.0), Some(60.0), &[(&[1.0], 3700), (&[5.0], 1250), (&[15.0], 460), (&[50.0], 150)], [600, 600]),
    pair(grid(0.9, 500.0, 200.0), Some(89.0), &[(&[1.0], 2400), (&[5.0],  560), (&[15.0], 200), (&[50.0], 120)], [500, 500]),
    pair(grid(0.1, 500.0, 400.0), NORMAL,     &[(&[1.0], 3600), (&[5.0], 1000), (&[25.0], 230), (&[50.0], 110)], [450, 550]),
    pair(grid(0.9, 500.0, 400.0), Some(60.0), &[(&[1.0], 2200), (&[5.0],  570), (&[15.0], 190), (&[50.0],  60)], [450, 500]),
    // some corners at another incidence angle
    pair(grid(0.1, 100.0, 200.0), Some(89.0), &[(&[1.0, 3.0], 800)],              [250, 450]),
    pair(grid(0.9, 100.0, 400.0), Some(60.0), &[(&[1.0, 2.0], 500)],              [200, 450]),
    pair(grid(0.9, 500.0, 200.0), NORMAL,     &[(&[2.0], 2200), (&[7.0], 750)],   [450, 480]),
    pair(grid(0.1, 500.0, 400.0), Some(89.0), &[(&[1.0], 2300), (&[5.0], 550)],   [450, 480]),
    // interior of the grid
    pair(grid(0.5, 300.0, 300.0), NORMAL,     &[(&[2.0], 1200), (&[5.0], 540), (&[10.0], 300)], [370, 490]),
    pair(grid(0.3, 200.0, 250.0), Some(30.0), &[(&[1.5], 1300), (&[5.0, 7.0], 450)],            [350, 480]),
    pair(grid(0.7, 400.0, 350.0), Some(80.0), &[(&[3.0], 700), (&[7.0, 15.0], 330)],            [330, 480]),
    pair(grid(0.3, 450.0, 300.0), Some(50.0), &[(&[1.5, 3.0], 1900), (&[10.0], 380)],           [500, 450]),
    pair(grid(0.7, 150.0, 300.0), Some(70.0), &[(&[1.0, 2.0], 820), (&[5.0], 500)],             [250, 440]),
    pair(grid(0.5, 250.0, 350.0), Some(20.0), &[(&[15.0], 165), (&[35.0], 56)],                   [260, 450]),
    pair(grid(0.5, 350.0, 250.0), Some(40.0), &[(&[3.0, 7.0], 1030)],                           [420, 480]),
    pair(grid(0.3, 350.0, 350.0), Some(10.0), &[(&[25.0, 35.0], 115)],                          [420, 480]),
    // outside the grid
    pair(WET,    NORMAL,     &[(&[1.0], 4500), (&[5.0], 1250), (&[12.0], 480)], [600, 550]),
    pair(WET,    Some(60.0), &[(&[1.0], 3500), (&[5.0],  960), (&[12.0], 380)], [500, 550]),
    pair(FINE,   DIFFUSE,    &[(&[1.0],  660), (&[3.0],   450)],                [220, 480]),
    pair(COARSE, NORMAL,     &[(&[2.0], 4000), (&[10.0], 1300)],                [700, 450]),
    pair(BROAD,  Some(30.0), &[(&[3.0], 1850), (&[12.0],  600)],                [440, 400]),
    pair(SMOOTH, NORMAL,     &[(&[1.0], 3000), (&[5.0],   770)],                [500, 470]),
    pair(ROUGH,  Some(60.0), &[(&[1.0], 1460), (&[5.0],   450)],                [330, 480]),
    pair(DRY,    DIFFUSE,    &[(&[1.0], 2900), (&[5.0],   770), (&[12.0], 370)], [550, 470]),
];
