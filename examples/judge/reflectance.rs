//! Reflectance and transmittance: natural snow of two thicknesses (Letcher et al. 2022), spheres
//! by another model, and statements of Varsa 2025.
use splitsnow::colour::Colorimeter;
use splitsnow::engine::{Cache, Engine};
use splitsnow::grain::TruncatedNormal;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::transport::{Illumination, Snow, Snowpack};
use splitsnow::units::cm_to_m;

use crate::variants::Variant;
use crate::{Result, Runner, rows};

/// Density of ice, kg/m3, with which measured specific surface areas are optical radii.
const ICE_KG_M3: f64 = 917.0;

/// The data of [`statements`].
pub(crate) const STATEMENTS: &str = "Varsa 2025";

/// A given value and the computed one.
pub(crate) struct Pair {
    pub(crate) data: &'static str,
    /// What was measured, with its unit.
    pub(crate) condition: String,
    pub(crate) given: f64,
    pub(crate) computed: [f64; 2],
}

/// A spectrum of a slab in collimated light.
fn spectrum(
    runner: &Runner,
    variant: &Variant,
    snow: Snow,
    (thickness_cm, incidence_deg): (f64, f64),
    wavelengths_nm: &[f64],
) -> Result<Spectrum> {
    let illumination = Illumination::Collimated {
        polar_angle_rad: incidence_deg.to_radians(),
    };
    let snowpack: Snowpack = snow.into();
    let thickness = [cm_to_m(thickness_cm)];
    let illuminations = [illumination];
    let request = runner.request(
        &snowpack,
        &thickness,
        &illuminations,
        wavelengths_nm,
        variant,
    );
    let mut spectra = runner.with(&Cache::default(), |control| {
        Engine::Hybrid.run(&request, control)
    })?;
    Ok(spectra.remove(0))
}

/// Specific surface areas tried for the natural snow, m2/kg. The first is that of the thin slab
/// by micro-CT; the deep snow has 18 to 27.
const SSA_M2_KG: [f64; 5] = [26.1, 23.0, 29.0, 32.0, 36.0];

/// Snow over a black panel, seen from above under a diffuse sky. By reciprocity this is the
/// reflectance at normal incidence. One specific surface area serves both thicknesses: first the
/// measured one, then the one that fits best.
pub(crate) fn natural(runner: &Runner, variant: &Variant) -> Result<Vec<Pair>> {
    let rows = rows(include_str!("../../tests/data/crrel_uvd_2021.csv"));
    let slabs = |ssa_m2_kg: f64, data: [&'static str; 2]| -> Result<Vec<Pair>> {
        let mut pairs = Vec::new();
        for (slab, data) in rows.chunk_by(|a, b| a[0] == b[0]).zip(data) {
            let (thickness_cm, density_kg_m3) = (slab[0][0], slab[0][1]);
            let radius_um = 3e6 / (ssa_m2_kg * ICE_KG_M3);
            let snow = variant.snow(radius_um, density_kg_m3, -11.0);
            let nm: Vec<f64> = slab.iter().map(|row| row[3]).collect();
            let found = spectrum(runner, variant, snow, (thickness_cm, 0.0), &nm)?;
            pairs.extend(slab.iter().zip(&found.reflectance).map(|(row, m)| Pair {
                data,
                condition: format!("R at {} nm, {ssa_m2_kg} m2/kg", row[3]),
                given: row[4],
                computed: [m.value, m.se],
            }));
        }
        Ok(pairs)
    };
    let mut pairs = slabs(SSA_M2_KG[0], ["snow, 34 cm", "snow, 2.5 cm"])?;
    let candidates =
        SSA_M2_KG.map(|ssa| slabs(ssa, ["snow, 34 cm, fitted", "snow, 2.5 cm, fitted"]));
    let candidates: Vec<_> = candidates.into_iter().collect::<Result<_>>()?;
    let misfit = |pairs: &Vec<Pair>| -> f64 {
        let squares = pairs
            .iter()
            .map(|pair| (pair.computed[0] - pair.given).powi(2));
        squares.sum()
    };
    let best = candidates
        .into_iter()
        .min_by(|a, b| misfit(a).total_cmp(&misfit(b)));
    pairs.extend(best.into_iter().flatten());
    Ok(pairs)
}

/// Spheres of optical radius 82 um: medium granular snow of the Johns Hopkins library in ECOSTRESS
/// (Baldridge et al. 2009), modelled below 2.08 um.
pub(crate) fn spheres(runner: &Runner, variant: &Variant) -> Result<Vec<Pair>> {
    let table = rows(include_str!(
        "../../tests/data/measured/ecostress_medium_converted.csv"
    ));
    let table: Vec<_> = table
        .into_iter()
        .filter(|row| (400.0..=1350.0).contains(&row[0]) && row[0] % 50.0 == 0.0)
        .collect();
    let nm: Vec<f64> = table.iter().map(|row| row[0]).collect();
    let snow = variant.snow(82.0, 300.0, -1.0);
    let found = spectrum(runner, variant, snow, (50.0, 10.0), &nm)?;
    let pairs = table.iter().zip(&found.reflectance).map(|(row, m)| Pair {
        data: "spheres, 82 um",
        condition: format!("R at {} nm", row[0]),
        given: row[1],
        computed: [m.value, m.se],
    });
    Ok(pairs.collect())
}

/// Statements of Varsa 2025 about the representative grains, with the options of the variant.
pub(crate) fn statements(runner: &Runner, variant: &Variant) -> Result<Vec<Pair>> {
    let lengths_um = [300.0, 750.0];
    let mut pairs = Vec::new();
    let mut add = |condition: &str, given: f64, found: Measured| {
        pairs.push(Pair {
            data: STATEMENTS,
            condition: condition.to_owned(),
            given,
            computed: [found.value, found.se],
        });
    };
    let wet = Snow {
        water_saturation: 0.05,
        ..Snow::dry(variant.sized(lengths_um), 275.0, -1.0)
    };
    let nm = [842.25, 1037.76, 1237.93];
    let found = spectrum(runner, variant, wet, (25.0, 62.3), &nm)?;
    for ((nm, given), found) in nm.iter().zip([0.878, 0.692, 0.495]).zip(found.reflectance) {
        add(
            &format!("R at {nm:.0} nm, 25 cm, 62.3 degrees"),
            given,
            found,
        );
    }
    let slabs = [
        ("T at 630 nm, 12 cm", 0.02, lengths_um, 275.0, 12.0, 630.0),
        (
            "T at 550 nm, 2.5 cm, 100 kg/m3",
            0.25,
            lengths_um,
            100.0,
            2.5,
            550.0,
        ),
        (
            "T at 550 nm, 2.5 cm, 450-550 um",
            0.10,
            [450.0, 550.0],
            275.0,
            2.5,
            550.0,
        ),
    ];
    for (condition, given, lengths_um, density, thickness_cm, nm) in slabs {
        let snow = Snow::dry(variant.sized(lengths_um), density, -1.0);
        let found = spectrum(runner, variant, snow, (thickness_cm, 0.0), &[nm])?;
        add(condition, given, found.transmittance[0]);
    }
    let nm: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
    let colorimeter = Colorimeter::new(&nm)?.ok_or("no colour")?;
    let difference = |seed: u64| -> Result<f64> {
        let transmittance = |facetness: f64| -> Result<Vec<f64>> {
            let law = TruncatedNormal::new(facetness - 0.1, facetness + 0.1, facetness, 0.072)?;
            let snow = Snow::dry(variant.grain([350.0, 450.0], law), 300.0, -1.0);
            let runner = Runner { seed, ..*runner };
            let found = spectrum(&runner, variant, snow, (15.0, 0.0), &nm)?;
            Ok(found.transmittance.iter().map(|m| m.value).collect())
        };
        Ok(colorimeter.difference(&transmittance(0.1)?, &transmittance(0.9)?))
    };
    let found: Vec<f64> = (1..=4).map(difference).collect::<Result<_>>()?;
    let mean = found.iter().sum::<f64>() / 4.0;
    let variance = found.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 3.0;
    let delta_e = Measured {
        value: mean,
        se: (variance / 4.0).sqrt(),
    };
    add("Delta-E of T, facetness 0.1 and 0.9, 15 cm", 3.4, delta_e);
    Ok(pairs)
}
