//! How snowpacks are cut into boundary layers and what is between, and what is to be
//! walked.
use super::planes::{Piece, pieces};
use super::{FROM_BELOW, JOINT, LAYER, THIN};
use crate::engine::tables::{PARTS, Stretch, stretches};
use crate::engine::{Request, identity};
use crate::slab::Streams;
use crate::table::{Edge, Source};
use crate::transport::{Illumination, Snow};

/// Walks of one kind from one source.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Task {
    /// What of a snowpack it walks through.
    pub(super) kind: Kind,
    /// From the surface that light comes to, inward.
    pub(super) stretches: Vec<Stretch>,
    pub(super) edges: [Edge; 2],
    pub(super) source: Source,
    /// Moments of the directions of what is handed over.
    pub(super) moments: usize,
    /// Per part.
    pub(super) rays: u64,
}

/// What of a snowpack is walked through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A boundary layer.
    Layer = 4,
    /// All of a thin one.
    Thin = 5,
    /// What is next to a plane inside.
    Joint = 6,
}

impl Task {
    /// What its random streams are for: a function of what is walked alone, not
    /// of what else is. Two tasks alike are the same walks.
    pub(super) fn purpose(&self) -> [u32; 3] {
        let bits = identity::of_walks("walks", &self.stretches, &self.source);
        [self.kind as u32, bits as u32, (bits >> 32) as u32]
    }

    /// Scores of a walk that leaves above, and of one that leaves below: moments
    /// where the snow goes on, light alone where it ends.
    pub(super) fn columns(&self) -> [usize; 2] {
        match self.edges[0] {
            Edge::Open => [self.moments; 2],
            Edge::Plane => [1, self.moments],
        }
    }
}

/// A snowpack of one thickness.
#[derive(Debug, Clone)]
pub(super) enum Slab {
    /// Walked from plane to plane: its first task, one per light.
    Thin(usize),
    /// Cut up.
    Thick(Cut),
}

/// A snowpack cut into two boundary layers and what is between.
#[derive(Debug, Clone)]
pub(super) struct Cut {
    /// Position of the upper boundary layer in [`Plan::layers`].
    pub(super) upper: usize,
    /// The same of the lower one.
    pub(super) lower: usize,
    /// Between them, downward; what is walked by its position in [`Plan::joints`].
    pub(super) inside: Vec<Piece<usize>>,
}

/// A boundary layer: its first task, one per stream and then, if it is an upper
/// one, one per light; and the snow that it ends in.
#[derive(Debug, Clone)]
pub(super) struct BoundaryLayer {
    pub(super) first: usize,
    pub(super) is_lit: bool,
    pub(super) snow: usize,
    stretches: Vec<Stretch>,
}

/// What is next to a plane between layers: its first task, one per stream above and
/// then one per stream below.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    pub(super) first: usize,
    pub(super) stretches: Vec<Stretch>,
}

/// All that is to be walked for a request.
#[derive(Debug, Clone, Default)]
pub(super) struct Plan {
    pub(super) tasks: Vec<Task>,
    pub(super) layers: Vec<BoundaryLayer>,
    pub(super) joints: Vec<Joint>,
    /// Per thickness.
    pub(super) slabs: Vec<Slab>,
}

/// The stretches of a snowpack down to where grains do not feel its plane.
fn boundary(snowpack: &[Stretch], snows: &[&Snow]) -> Vec<Stretch> {
    let (distances, grains) = LAYER;
    let (mut depth_m, mut top_m) = (0.0_f64, 0.0);
    for stretch in snowpack {
        let snow = snows[stretch.snow];
        let [_, longest_m] = snow.sizes_m();
        if top_m > 0.0 && top_m >= depth_m && top_m >= longest_m {
            break;
        }
        let needed_m = (distances * snow.mean_free_distance_m()).max(grains * longest_m);
        depth_m = depth_m.max(needed_m);
        top_m += stretch.thickness_m;
    }
    let mut left_m = depth_m;
    let mut taken = Vec::new();
    for stretch in snowpack {
        if left_m <= 0.0 {
            break;
        }
        let thickness_m = left_m.min(stretch.thickness_m);
        taken.push(Stretch {
            thickness_m,
            ..*stretch
        });
        left_m -= thickness_m;
    }
    taken
}

fn depth_m(stretches: &[Stretch]) -> f64 {
    stretches.iter().map(|stretch| stretch.thickness_m).sum()
}

/// `snowpack` without `cut` at its upper end.
fn without(snowpack: &[Stretch], cut: &[Stretch]) -> Vec<Stretch> {
    let whole = cut.len().saturating_sub(1);
    let mut rest = snowpack[whole..].to_vec();
    if let (Some(first), Some(last)) = (rest.first_mut(), cut.last()) {
        first.thickness_m -= last.thickness_m;
    }
    rest.retain(|stretch| stretch.thickness_m > 0.0);
    rest
}

fn source(light: &Illumination) -> Source {
    match light {
        Illumination::Collimated { polar_angle_rad } => Source::Above(libm::cos(*polar_angle_rad)),
        Illumination::Diffuse => Source::Diffuse,
    }
}

impl Plan {
    pub(super) fn new(request: &Request, streams: &Streams) -> Self {
        let snows: Vec<&Snow> = request.snowpack.snows().collect();
        let mut plan = Self::default();
        let mut thin = Vec::new();
        for (h, thickness_m) in request.thicknesses_m.iter().enumerate() {
            let snowpack = stretches(request, *thickness_m);
            let mut flipped = snowpack.clone();
            flipped.reverse();
            let (upper, lower) = (boundary(&snowpack, &snows), boundary(&flipped, &snows));
            let both_m = depth_m(&upper) + depth_m(&lower);
            if *thickness_m <= 0.5 * THIN * both_m {
                thin.push((h, snowpack));
                // its place is known when all boundary layers are
                plan.slabs.push(Slab::Thin(0));
                continue;
            }
            let mut inside = without(&snowpack, &upper);
            inside.reverse();
            inside = without(&inside, &lower);
            inside.reverse();
            let upper = plan.layer(request, streams, upper, true);
            let lower = plan.layer(request, streams, lower, false);
            let pieces = pieces(&inside, &snows).into_iter();
            let inside = pieces
                .map(|piece| match piece {
                    Piece::Points(stretch) => Piece::Points(stretch),
                    Piece::Walked(walked) => Piece::Walked(plan.joint(request, streams, walked)),
                })
                .collect();
            plan.slabs.push(Slab::Thick(Cut {
                upper,
                lower,
                inside,
            }));
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        for (h, snowpack) in thin {
            plan.slabs[h] = Slab::Thin(plan.tasks.len());
            let tasks = request.illuminations.iter().map(|light| Task {
                kind: Kind::Thin,
                stretches: snowpack.clone(),
                edges: [Edge::Plane; 2],
                source: source(light),
                moments: 1,
                rays,
            });
            plan.tasks.extend(tasks);
        }
        plan
    }

    /// The position of a boundary layer of these `stretches`, which is made if
    /// there is none.
    fn layer(
        &mut self,
        request: &Request,
        streams: &Streams,
        stretches: Vec<Stretch>,
        is_lit: bool,
    ) -> usize {
        let same =
            |layer: &BoundaryLayer| layer.stretches == stretches && (layer.is_lit || !is_lit);
        if let Some(there) = self.layers.iter().position(same) {
            return there;
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        let below = ((rays as f64 * FROM_BELOW).ceil() as u64).max(1);
        let lights: &[Illumination] = if is_lit { request.illuminations } else { &[] };
        let cosines = streams.cosines().iter();
        let sources = cosines.map(|cosine| (Source::Below(*cosine), below));
        let sources = sources.chain(lights.iter().map(|light| (source(light), rays)));
        let first = self.tasks.len();
        self.tasks.extend(sources.map(|(source, rays)| Task {
            kind: Kind::Layer,
            stretches: stretches.clone(),
            edges: [Edge::Plane, Edge::Open],
            source,
            moments: streams.count(),
            rays,
        }));
        self.layers.push(BoundaryLayer {
            first,
            is_lit,
            snow: stretches.last().map_or(0, |stretch| stretch.snow),
            stretches,
        });
        self.layers.len() - 1
    }

    /// The position of what is next to a plane, of these `stretches`, which is made
    /// if there is none.
    fn joint(&mut self, request: &Request, streams: &Streams, stretches: Vec<Stretch>) -> usize {
        let mut all = self.joints.iter();
        if let Some(there) = all.position(|joint| joint.stretches == stretches) {
            return there;
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        let rays = ((rays as f64 * JOINT).ceil() as u64).max(1);
        let cosines = || streams.cosines().iter().copied();
        let sources = cosines()
            .map(Source::Over)
            .chain(cosines().map(Source::Below));
        let first = self.tasks.len();
        self.tasks.extend(sources.map(|source| Task {
            kind: Kind::Joint,
            stretches: stretches.clone(),
            edges: [Edge::Open; 2],
            source,
            moments: streams.count(),
            rays,
        }));
        self.joints.push(Joint { first, stretches });
        self.joints.len() - 1
    }
}
