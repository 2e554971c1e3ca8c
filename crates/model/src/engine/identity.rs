//! Identity of a database node: 64 bits computed from the node's own parameters
//! alone. They key the random streams of its walks ([`crate::rng`]).
//!
//! A node gets the same random streams in every grid and at every position in it, so
//! a grid that grows keeps its spectra. The bits are the [`Fingerprint`] of
//!
//! - the snow of each layer: grains (share, size, facetness, shape, proportion), density,
//!   temperature, saturation, and the carbon and other absorbers; the thicknesses of the
//!   layers under the surface; the reflectance of the substrate;
//! - the illumination and the thickness, if the engine computes them one by one.
//!
//! They do not include what a whole database has in common (seed, wavelengths, engine,
//! walks, model options, optical tables): the seed is part of every key of a random
//! stream, and databases that differ in the rest share no nodes.
use crate::grain::TruncatedNormal;
use crate::optics::MassAbsorption;
use crate::rng::Fingerprint;
use crate::table::Source;
use crate::transport::{Illumination, Snow, Snowpack, Substrate};

use super::tables::Section;

/// Identity of a snowpack, without its thickness.
#[must_use]
pub fn of_snowpack(snowpack: &Snowpack) -> u64 {
    let mut digest = with_snow(Fingerprint::of("pack"), &snowpack.surface);
    for layer in &snowpack.below {
        digest = with_snow(digest.and(&[layer.thickness_m]), &layer.snow);
    }
    let digest = match &snowpack.substrate {
        Substrate::Black => digest.and_text("black"),
        Substrate::Grey(reflectance) => digest.and_text("grey").and(&[*reflectance]),
        Substrate::Spectrum { table, .. } => digest
            .and_text("spectrum")
            .and(table.abscissae())
            .and(table.column(0)),
    };
    digest.finish()
}

fn with_snow(digest: Fingerprint, snow: &Snow) -> Fingerprint {
    let law = |law: &TruncatedNormal| [law.min(), law.max(), law.mean(), law.sd()];
    let mut digest = digest.and_text("snow").and(&[
        snow.density_kg_m3,
        snow.temperature_c,
        snow.water_saturation,
    ]);
    for component in &snow.grains {
        let grain = &component.grain;
        digest = digest
            .and(&[component.fraction, grain.size.min_m(), grain.size.max_m()])
            .and_text(grain.size.law().name())
            .and(&law(&grain.facetness))
            .and(&law(&grain.proportion));
        digest = grain.shape.identify(digest);
    }
    for (name, carbon) in [("black", &snow.black_carbon), ("brown", &snow.brown_carbon)] {
        // carbon of concentration 0 does not affect the identity
        if let Some(carbon) = carbon.filter(|carbon| carbon.concentration_ng_g > 0.0) {
            digest = digest.and_text(name).and(&[
                carbon.concentration_ng_g,
                carbon.sedimentation,
                carbon.mass_absorption_efficiency_m2_g,
                carbon.reference_wavelength_nm,
                carbon.angstrom_exponent,
                f64::from(u8::from(carbon.per_wet_mass)),
            ]);
        }
    }
    // what absorbs is identified by its numbers, not by its name
    for absorber in snow.absorbers() {
        let wet = f64::from(u8::from(absorber.per_wet_mass));
        let amount = [absorber.concentration_ng_g, absorber.sedimentation, wet];
        digest = digest.and_text("absorber").and(&amount);
        digest = match &absorber.mass_absorption {
            MassAbsorption::Power {
                m2_g,
                reference_nm,
                angstrom_exponent,
            } => digest.and(&[*m2_g, *reference_nm, *angstrom_exponent]),
            MassAbsorption::Table(table) => digest
                .and_text("table")
                .and(table.abscissae())
                .and(table.column(0)),
        };
        if let Some(scattering) = absorber.scattering {
            let numbers = [scattering.m2_g, scattering.asymmetry];
            digest = digest.and_text("scattering").and(&numbers);
        }
    }
    digest
}

/// Identity of the node `cell` under one illumination.
#[must_use]
pub fn with_light(cell: u64, light: &Illumination) -> u64 {
    let digest = Fingerprint::of("light").and_bits(cell);
    let digest = match light {
        Illumination::Collimated { polar_angle_rad } => digest.and(&[*polar_angle_rad]),
        Illumination::Diffuse => digest.and_text("diffuse"),
    };
    digest.finish()
}

/// Identity of the node `cell` at one thickness.
#[must_use]
pub fn with_thickness(cell: u64, thickness_m: f64) -> u64 {
    let digest = Fingerprint::of("thickness").and_bits(cell);
    digest.and(&[thickness_m]).finish()
}

/// Identity of walks within a node, of one `kind`: from `source` through `sections`.
pub(super) fn of_walks(kind: &str, sections: &[Section], source: &Source) -> u64 {
    let mut digest = Fingerprint::of(kind);
    for Section { layer, thickness_m } in sections {
        digest = digest.and_bits(*layer as u64).and(&[*thickness_m]);
    }
    let digest = match source {
        Source::Above(cosine) => digest.and_text("above").and(&[*cosine]),
        Source::Diffuse => digest.and_text("diffuse"),
        Source::Below(cosine) => digest.and_text("below").and(&[*cosine]),
        Source::Over(cosine) => digest.and_text("over").and(&[*cosine]),
    };
    digest.finish()
}
