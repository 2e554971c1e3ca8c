//! Prints the scattering properties of a sample's grains, for use in other programs:
//! single-scattering albedo and Legendre moments at the sample's wavelengths, as CSV.
//!
//! `cargo run --release --example kernel -- SAMPLE.toml > kernel.csv`
//!
//! The grains are those of the surface layer's first grain type, without carbon and in
//! dry pores. The first lines start with #. They give the mean free distance, which
//! converts thickness to optical thickness, and the specific surface area (Varsa 2025,
//! appendix B).
#![allow(clippy::print_stdout)]
use std::path::PathBuf;

use anyhow::{Context, bail};
use splitsnow::config::sample;
use splitsnow::grain::{Surface, mean_free_distance_m, specific_surface_m2_kg};
use splitsnow::optics::{Index, ice_density_kg_m3};
use splitsnow::rng::{Key, Stream};
use splitsnow::table::{Kernel, draw};

/// Legendre moments printed: enough for 32 streams.
const MOMENTS: usize = 33;
/// Grain events averaged at each wavelength.
const EVENTS: usize = 1 << 19;

fn main() -> anyhow::Result<()> {
    let path = std::env::args_os()
        .nth(1)
        .context("usage: kernel SAMPLE.toml")?;
    let sample = sample::read(&PathBuf::from(path))?;
    let snow = &sample.snowpack.surface;
    if snow.water_saturation > 0.0 || snow.black_carbon.is_some() || snow.brown_carbon.is_some() {
        bail!("the sample must be dry snow without carbon; set water and carbon to 0");
    }
    let grain = &snow.grains[0].grain;
    let size_m = [grain.size.min_m(), grain.size.max_m()];
    let free_m = mean_free_distance_m(grain, snow.density_kg_m3, snow.temperature_c);
    let ice_kg_m3 = ice_density_kg_m3(snow.temperature_c);
    let ssa = specific_surface_m2_kg(grain, snow.temperature_c);
    println!("# thickness_m {}", sample.thickness_m);
    println!("# density_kg_m3 {}", snow.density_kg_m3);
    println!("# ice_density_kg_m3 {ice_kg_m3}");
    println!("# mean_free_distance_m {free_m:e}");
    println!("# specific_surface_area_m2_kg {ssa}");
    let moments: Vec<_> = (1..MOMENTS).map(|l| format!("p{l}")).collect();
    println!(
        "wavelength_nm,n,ice_absorption_per_m,mean_path_m,effective_free_path_m,albedo,{}",
        moments.join(",")
    );
    for (i, &nm) in sample.wavelengths_nm.iter().enumerate() {
        let ice = sample.model.ice.at(nm)?;
        let vacuum = Index { n: 1.0, k: 0.0 };
        let [air, _] = Surface::in_air_and_water(ice, vacuum, false);
        let stream = Stream::new(Key {
            seed: 1,
            cell: i as u64,
            purpose: [11, 0, 0],
            batch: 0,
        });
        let event = (sample.model.entry, sample.model.facets);
        let outcomes = draw(grain, event, air, EVENTS, stream);
        let kernel = Kernel::new(&outcomes, MOMENTS);
        let per_m = 4.0e9 * std::f64::consts::PI * ice.k / nm;
        let event = kernel.event(size_m, per_m);
        let clear = kernel.event(size_m, 0.0).moments[0];
        // the mean path in ice from weak absorption: at most 1 % over the longest grain
        let weak = 0.01 / size_m[1];
        let path_m = (clear - kernel.event(size_m, weak).moments[0]) / weak;
        let effective_m = event.effective_mean_free_path_m([free_m, free_m]);
        let albedo = event.moments[0];
        let rest: Vec<_> = event.moments[1..]
            .iter()
            .map(|m| format!("{:.6}", m / albedo))
            .collect();
        println!(
            "{nm},{:.5},{per_m:.5e},{path_m:.5e},{effective_m:.5e},{albedo:.7},{}",
            ice.n,
            rest.join(",")
        );
    }
    Ok(())
}
