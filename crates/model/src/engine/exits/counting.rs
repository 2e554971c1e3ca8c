//! Scores walks where they end, with a weight for the absorption at each wavelength.
use std::borrow::Cow;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::parts::{self, PartScores};
use super::{ExitScene, Exits, at_nodes};
use crate::engine::spectral::DEFERRED;
use crate::engine::{
    Engine, EngineError, coefficients, engine_error, indices, substrate::SubstrateCoefficients,
};
use crate::math::Vec3;
use crate::measurement::{Radii, Sensors, Views};
use crate::optics::Index;
use crate::transport::{Absorption, Bounce, Coefficients, End, Path, Sink, Walk, Walker};

/// Bins into which exits are sorted.
pub(super) trait Bins: Sync {
    /// Number of bins per side.
    fn len(&self) -> usize;

    /// The bin of a walk that ends with this path and direction.
    fn bin(&self, path: &Path, direction: Vec3) -> usize;

    /// See [`Sensors::symmetrise`].
    fn symmetrise(&self, _axial: bool, _sums: &mut [f64], _bands: usize) {}

    /// Number of results per side.
    fn results(&self) -> usize {
        self.len()
    }

    /// The results of one side, `[result][band]`, from its sums, `[bin][band]`. Linear in the sums.
    fn reduced<'a>(&self, sums: &'a [f64], _bands: usize) -> Cow<'a, [f64]> {
        Cow::Borrowed(sums)
    }
}

/// Bins of directions.
pub(super) trait DirectionBins: Bins {
    /// The sensors that are the bins.
    fn sensors(&self) -> &Sensors;

    /// A result if the side emits unit power as a Lambertian surface does.
    fn lambertian(&self, result: usize) -> f64;
}

impl DirectionBins for Sensors {
    fn sensors(&self) -> &Sensors {
        self
    }

    fn lambertian(&self, result: usize) -> f64 {
        self.projected_sr(result) / PI
    }
}

impl DirectionBins for Views {
    fn sensors(&self) -> &Sensors {
        self.sensors()
    }

    fn lambertian(&self, _: usize) -> f64 {
        1.0 / PI
    }
}

impl Bins for Views {
    fn len(&self) -> usize {
        self.sensors().len()
    }

    fn bin(&self, _: &Path, direction: Vec3) -> usize {
        self.sensors().folded(direction)
    }

    fn symmetrise(&self, axial: bool, sums: &mut [f64], bands: usize) {
        self.sensors().symmetrise(axial, sums, bands);
    }

    fn results(&self) -> usize {
        self.len()
    }

    fn reduced<'a>(&self, sums: &'a [f64], bands: usize) -> Cow<'a, [f64]> {
        Cow::Owned(self.brdf_per_sr(sums, bands))
    }
}

impl Bins for Sensors {
    fn len(&self) -> usize {
        self.len()
    }

    fn bin(&self, _: &Path, direction: Vec3) -> usize {
        self.folded(direction)
    }

    fn symmetrise(&self, axial: bool, sums: &mut [f64], bands: usize) {
        self.symmetrise(axial, sums, bands);
    }
}

impl Bins for Radii {
    fn len(&self) -> usize {
        self.len()
    }

    fn bin(&self, path: &Path, _: Vec3) -> usize {
        self.index(path.offset_m)
    }
}

/// Largest probability that a walk is reflected by the substrate. Even if the
/// substrate reflects all light at all wavelengths, some walks end in it, so that no
/// walk goes on for ever; the weights compensate for this.
const MOST_REFLECTED: f64 = 0.999;

struct Counts<'a, B> {
    bins: &'a B,
    absorption: Absorption,
    coefficients: &'a [Coefficients],
    substrate: &'a [SubstrateCoefficients],
    /// Probability that a walk is reflected by the substrate.
    bounce: f64,
    part: PartScores,
    cancel: &'a AtomicBool,
}

impl<B: Bins> Sink for Counts<'_, B> {
    fn end(&mut self, _: Range<usize>, end: End, path: &Path, direction: Vec3) {
        let side = match end {
            End::Reflected => 0,
            End::Transmitted => 1,
            End::Lost => {
                self.part.lost += 1;
                return;
            }
            End::Absorbed => return,
        };
        let bands = self.coefficients.len();
        let bin = self.bins.bin(path, direction);
        let row = (side * self.bins.len() + bin) * bands;
        let sums = self.part.sums[row..row + bands].iter_mut();
        for ((sum, coefficients), substrate) in sums.zip(self.coefficients).zip(self.substrate) {
            let mut weight = self.absorption.weight(path, coefficients);
            for _ in 0..path.bounces {
                weight *= substrate.reflectance.value / self.bounce;
            }
            if end == End::Transmitted {
                weight *= substrate.transmittance.value / (1.0 - self.bounce);
            }
            *sum += weight;
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

/// Walks and scores `scene`. `reference` walks every wavelength on its own, with
/// analog absorption.
pub(super) fn run(scene: &ExitScene, bins: &impl Bins) -> Result<Vec<Exits>, EngineError> {
    if scene.engine == Engine::Reference {
        let indices = indices(scene.request)?;
        let walk_wavelength =
            |(l, index): (usize, &(Index, Index))| walk(scene, bins, (8, l), *index, l..l + 1, 0.0);
        let exits = indices.iter().enumerate().map(walk_wavelength);
        return Ok(exits.collect::<Result<Vec<_>, _>>()?.concat());
    }
    at_nodes(scene, |node| {
        walk(
            scene,
            bins,
            (9, node.number),
            node.indices,
            node.span,
            DEFERRED,
        )
    })
}

/// Walks at one pair of indices, scored at the wavelengths of `span`.
fn walk(
    scene: &ExitScene,
    bins: &impl Bins,
    (purpose, number): (u32, usize),
    index: (Index, Index),
    span: Range<usize>,
    deferred: f64,
) -> Result<Vec<Exits>, EngineError> {
    let request = scene.request;
    let coefficients = &coefficients(request, &indices(request)?)[span.clone()];
    let substrate = &scene.substrate[span];
    let absorption = Absorption {
        coefficients: Coefficients::least(coefficients),
        deferred,
    };
    let largest = substrate
        .iter()
        .map(|g| g.reflectance.value)
        .fold(0.0, f64::max);
    let bounce = largest.min(MOST_REFLECTED);
    // the sums are those of all layers, in the same order as in the coefficients
    let (tracers, snow) = (request.tracers(), (scene.snowpack, request.model));
    let walker = Walker::with_tracers(snow, &tracers, index, absorption).over(Bounce {
        reflected: bounce,
        transmitted: 1.0 - bounce,
    });
    let (h, thickness_m) = scene.thickness;
    parts::run(scene, bins, coefficients.len(), |part, rays| {
        let mut counts = Counts {
            bins,
            absorption,
            coefficients,
            substrate,
            bounce,
            part: PartScores::empty(bins, coefficients.len()),
            cancel: scene.control.cancel,
        };
        let rng = parts::stream(scene, [purpose, h as u32, number as u32], part);
        walker
            .walk(&[thickness_m], scene.illumination(), rays, rng, &mut counts)
            .map_err(|error| engine_error(request, error))?;
        Ok(counts.part)
    })
}
