//! Looks up spectra in a compact file, with the crate `splitsnow-lookup` alone.
//!
//! `cargo run --release --example lookup -- out/quick/snow.safetensors`
#![allow(clippy::print_stdout)]
use splitsnow_lookup::{Database, Lookup, Parameter, Point, Quantity};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("usage: lookup FILE")?;
    let database = Database::open(path)?;
    let lookup = Lookup::new(&database, Quantity::Transmittance)?;
    let mut spectrum = vec![0.0; lookup.wavelengths()];
    for thickness_cm in [2.0, 5.0, 10.0] {
        let point = Point::from([
            (Parameter::Facetness, 0.3),
            (Parameter::GrainSize, 250.0),
            (Parameter::Density, 300.0),
            (Parameter::Thickness, thickness_cm),
            (Parameter::Incidence, 20.0),
        ]);
        lookup.spectrum(point, &mut spectrum)?;
        let mean = spectrum.iter().sum::<f32>() / spectrum.len() as f32;
        println!("{thickness_cm:4.1} cm: mean transmittance {mean:.4}");
    }
    Ok(())
}
