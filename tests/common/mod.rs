//! Helpers for the tests of the program and its files.
#![allow(dead_code, clippy::unwrap_used)]
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::Ordering;

use assert_cmd::cargo::cargo_bin;
use splitsnow::engine::{Control, Engine, EngineError, MaxError, Request};
use splitsnow::grain::TruncatedNormal;
use splitsnow::grid::{Compression, Fixed, Grid, Run, Spread};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::parameter::{Axes, Parameter};
use splitsnow::transport::Illumination;

/// The contents of all files below `path`. The keys are paths relative to `path`, with `/`.
pub(crate) fn dir_bytes(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![path.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let entry = entry.unwrap().path();
            if entry.is_dir() {
                folders.push(entry);
            } else {
                let name = entry.strip_prefix(path).unwrap().to_str().unwrap();
                files.insert(name.replace('\\', "/"), fs::read(&entry).unwrap());
            }
        }
    }
    files
}

/// Asserts that two directories, as read by [`dir_bytes`], are equal. The message names the
/// files that differ.
pub(crate) fn assert_same(left: &BTreeMap<String, Vec<u8>>, right: &BTreeMap<String, Vec<u8>>) {
    let names = left.keys().chain(right.keys());
    let mut differ: Vec<_> = names.filter(|n| left.get(*n) != right.get(*n)).collect();
    differ.dedup();
    assert!(differ.is_empty(), "files differ: {differ:?}");
}

/// A folder in which the program runs, with the grid file `g.toml`.
pub(crate) struct Folder(pub(crate) tempfile::TempDir);

impl Folder {
    pub(crate) fn new(grid: &str) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write("g.toml", grid);
        folder
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.0.path().join(name), text).unwrap();
    }

    /// The output directory of the grid file with this name.
    pub(crate) fn out(&self, name: &str) -> PathBuf {
        self.0.path().join("out").join(name)
    }

    pub(crate) fn command(&self, args: &str) -> Command {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command
            .current_dir(self.0.path())
            .args(args.split_whitespace());
        command
    }

    pub(crate) fn run(&self, args: &str) -> Output {
        self.command(args).output().unwrap()
    }

    /// The standard output of a run that must succeed.
    pub(crate) fn succeeds(&self, args: &str) -> String {
        let output = self.run(args);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{args}: {errors}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// The standard error of a run that must fail.
    pub(crate) fn fails(&self, args: &str) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(1), "{args}");
        String::from_utf8(output.stderr).unwrap()
    }
}

/// A small dry grid: 2 x 2 x 1 x 3 x 2 = 24 curves of 4 wavelengths.
pub(crate) fn grid(engine: Engine) -> Grid {
    Grid {
        axes: Axes::from([
            (Parameter::Facetness, vec![0.05, 0.5]),
            (Parameter::GrainSize, vec![100.0, 200.0]),
            (Parameter::Density, vec![300.0]),
            (Parameter::Thickness, vec![1.0, 2.0, 5.0]),
            (Parameter::Incidence, vec![0.0, 60.0]),
        ]),
        views: None,
        size_axis: None,
        spread: Spread {
            facetness_half_width: 0.1,
            facetness_sd: 0.072,
            grain_size_half_width_um: 50.0,
            ..Spread::default()
        },
        wavelengths_nm: vec![400.0, 500.0, 600.0, 700.0],
        fixed: Fixed::dry(TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(), -1.0),
        run: Run {
            engine,
            seed: 7,
            rays: 100,
            max_error: MaxError::default(),
        },
        compression: Compression {
            max_delta_e: 2.3,
            max_rmse: None,
        },
    }
}

/// Maps a cell number to a number in [0, 1), so that results of different nodes differ.
pub(crate) fn share(cell: u64) -> f64 {
    (cell >> 11) as f64 / (1_u64 << 53) as f64
}

/// A fake engine. It is fast, and its results depend only on the request.
pub(crate) fn simulate(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    if control.cancel.load(Ordering::Relaxed) {
        return Err(EngineError::Cancelled);
    }
    let grain = request.snowpack.longest_grain_m() / request.thicknesses_m[0];
    let illuminations = request.illuminations.iter();
    let curves = request.thicknesses_m.iter().flat_map(|h| {
        illuminations
            .clone()
            .map(move |illumination| (h, illumination))
    });
    let spectra = curves.map(|(thickness_m, illumination)| {
        let Illumination::Collimated { polar_angle_rad } = illumination else {
            return Err(EngineError::Cancelled);
        };
        let measured = |nm: &f64, scale: f64| Measured {
            value: scale * (-thickness_m * nm * polar_angle_rad.cos() * (1.0 - grain)).exp(),
            se: 1e-3 / (1.0 + share(request.cell) + request.seed as f64),
        };
        let nm = request.wavelengths_nm.iter();
        Ok(Spectrum {
            transmittance: nm.clone().map(|nm| measured(nm, 0.4)).collect(),
            reflectance: nm.clone().map(|nm| measured(nm, 0.5)).collect(),
            lost: nm.map(|_| share(request.cell) * 1e-6).collect(),
        })
    });
    control.rays_done.fetch_add(request.rays, Ordering::Relaxed);
    spectra.collect()
}
