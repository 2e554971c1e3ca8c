//! Divides snowpacks into boundary layers and an inside, and lists the walks to do.
use super::planes::{Segment, segments};
use super::{LAYER, RAYS_PER_INTERFACE_STREAM, RAYS_PER_STREAM, THIN};
use crate::engine::tables::{PARTS, Section, sections};
use crate::engine::{Request, identity};
use crate::slab::Streams;
use crate::table::{Edge, Source};
use crate::transport::{Illumination, Snow};

/// Walks through one region from one source.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WalkTask {
    /// Part of the snowpack that the region belongs to.
    pub(super) kind: RegionKind,
    /// Sections of the region, from the side of the light inward.
    pub(super) sections: Vec<Section>,
    pub(super) edges: [Edge; 2],
    pub(super) source: Source,
    /// Number of Legendre moments scored for the directions of light that leaves
    /// through an open edge.
    pub(super) moments: usize,
    /// Number of rays per part.
    pub(super) rays: u64,
    /// Depths from the upper end of the region at which light is counted, m, increasing.
    pub(super) planes_m: Vec<f64>,
}

/// Part of a snowpack that is walked. The values enter the random streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RegionKind {
    /// A boundary layer.
    Boundary = 4,
    /// A whole thin slab.
    Thin = 5,
    /// The snow next to a plane between layers.
    Interface = 6,
    /// A part in which light is counted.
    Window = 7,
}

impl WalkTask {
    /// Purpose of the task's random streams. It depends on the region and the source
    /// alone, not on other tasks; two equal tasks do the same walks.
    pub(super) fn purpose(&self) -> [u32; 3] {
        let bits = identity::of_walks("walks", &self.sections, &self.source);
        [self.kind as u32, bits as u32, (bits >> 32) as u32]
    }

    /// Number of scores of a walk that leaves above, and of one that leaves below:
    /// `moments` at an open edge, 1 (the light alone) at a plane.
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
    /// A slab walked from plane to plane: position of its first task in
    /// [`WalkPlan::tasks`], with one task per illumination.
    Thin(usize),
    /// A slab divided into boundary layers and an inside.
    Thick(ThickSlab),
}

/// A snowpack divided into two boundary layers and the inside between them.
#[derive(Debug, Clone)]
pub(super) struct ThickSlab {
    /// Position of the upper boundary layer in [`WalkPlan::boundary_layers`].
    pub(super) upper: usize,
    /// Position of the lower boundary layer in [`WalkPlan::boundary_layers`].
    pub(super) lower: usize,
    /// Segments of the inside, downward; walked segments are given by their
    /// position in [`WalkPlan::interfaces`].
    pub(super) inside: Vec<Segment<usize>>,
    /// Thickness of the upper boundary layer, m.
    pub(super) upper_m: f64,
}

/// A boundary layer.
#[derive(Debug, Clone)]
pub(super) struct BoundaryLayer {
    /// Position of its first task: one task per stream and then, if it is lit, one
    /// per illumination.
    pub(super) first: usize,
    /// Whether it is an upper boundary layer.
    pub(super) is_lit: bool,
    /// Number of the snowpack layer in which it ends.
    pub(super) layer: usize,
    sections: Vec<Section>,
}

/// The snow next to one or several planes between layers.
#[derive(Debug, Clone)]
pub(super) struct LayerInterface {
    /// Position of its first task: one task per stream above and then one per
    /// stream below.
    pub(super) first: usize,
    pub(super) sections: Vec<Section>,
}

/// All walks of a request.
#[derive(Debug, Clone, Default)]
pub(super) struct WalkPlan {
    pub(super) tasks: Vec<WalkTask>,
    pub(super) boundary_layers: Vec<BoundaryLayer>,
    pub(super) interfaces: Vec<LayerInterface>,
    /// Per thickness.
    pub(super) slabs: Vec<Slab>,
}

/// Depth to which a plane of the snowpack affects the grains of `snow` under it, m.
pub(super) fn needed_m(snow: &Snow) -> f64 {
    let (distances, grains) = LAYER;
    (distances * snow.mean_free_distance_m()).max(grains * snow.sizes_m()[1])
}

/// The upper sections of a snowpack, down to the depth at which its surface plane no
/// longer affects the grains.
fn boundary(snowpack: &[Section], snows: &[&Snow]) -> Vec<Section> {
    let (mut depth_m, mut top_m) = (0.0_f64, 0.0);
    for section in snowpack {
        let snow = snows[section.layer];
        let [_, longest_m] = snow.sizes_m();
        if top_m > 0.0 && top_m >= depth_m && top_m >= longest_m {
            break;
        }
        depth_m = depth_m.max(needed_m(snow));
        top_m += section.thickness_m;
    }
    let mut remaining_m = depth_m;
    let mut boundary = Vec::new();
    for section in snowpack {
        if remaining_m <= 0.0 {
            break;
        }
        let thickness_m = remaining_m.min(section.thickness_m);
        boundary.push(Section {
            thickness_m,
            ..*section
        });
        remaining_m -= thickness_m;
    }
    boundary
}

/// Thickness of `sections`, m.
pub(super) fn depth_m(sections: &[Section]) -> f64 {
    sections.iter().map(|section| section.thickness_m).sum()
}

/// `snowpack` without the sections `upper` at its upper end.
fn without(snowpack: &[Section], upper: &[Section]) -> Vec<Section> {
    let whole = upper.len().saturating_sub(1);
    let mut rest = snowpack[whole..].to_vec();
    if let (Some(first), Some(last)) = (rest.first_mut(), upper.last()) {
        first.thickness_m -= last.thickness_m;
    }
    rest.retain(|section| section.thickness_m > 0.0);
    rest
}

pub(super) fn source(light: &Illumination) -> Source {
    match light {
        Illumination::Collimated { polar_angle_rad } => Source::Above(libm::cos(*polar_angle_rad)),
        Illumination::Diffuse => Source::Diffuse,
    }
}

impl WalkPlan {
    pub(super) fn new(request: &Request, streams: &Streams) -> Self {
        let snows: Vec<&Snow> = request.snowpack.snows().collect();
        let mut plan = Self::default();
        let mut thin = Vec::new();
        for (h, thickness_m) in request.thicknesses_m.iter().enumerate() {
            let snowpack = sections(request, *thickness_m);
            let mut flipped = snowpack.clone();
            flipped.reverse();
            let (upper, lower) = (boundary(&snowpack, &snows), boundary(&flipped, &snows));
            let both_m = depth_m(&upper) + depth_m(&lower);
            if *thickness_m <= 0.5 * THIN * both_m {
                thin.push((h, snowpack));
                // the position of its tasks is set below, after all boundary layers
                plan.slabs.push(Slab::Thin(0));
                continue;
            }
            let mut inside = without(&snowpack, &upper);
            inside.reverse();
            inside = without(&inside, &lower);
            inside.reverse();
            let upper_m = depth_m(&upper);
            let upper = plan.boundary_layer(request, streams, upper, true);
            let lower = plan.boundary_layer(request, streams, lower, false);
            let segments = segments(&inside, &snows).into_iter();
            let inside = segments
                .map(|segment| match segment {
                    Segment::Bulk(section) => Segment::Bulk(section),
                    Segment::Walked(sections) => {
                        Segment::Walked(plan.interface(request, streams, sections))
                    }
                })
                .collect();
            plan.slabs.push(Slab::Thick(ThickSlab {
                upper,
                lower,
                inside,
                upper_m,
            }));
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        for (h, snowpack) in thin {
            plan.slabs[h] = Slab::Thin(plan.tasks.len());
            let tasks = request.illuminations.iter().map(|light| WalkTask {
                kind: RegionKind::Thin,
                sections: snowpack.clone(),
                edges: [Edge::Plane; 2],
                source: source(light),
                moments: 1,
                rays,
                planes_m: Vec::new(),
            });
            plan.tasks.extend(tasks);
        }
        plan
    }

    /// The position of the boundary layer with these `sections`, which is added if
    /// it is not in the plan yet.
    fn boundary_layer(
        &mut self,
        request: &Request,
        streams: &Streams,
        sections: Vec<Section>,
        is_lit: bool,
    ) -> usize {
        let matches =
            |layer: &BoundaryLayer| layer.sections == sections && (layer.is_lit || !is_lit);
        if let Some(position) = self.boundary_layers.iter().position(matches) {
            return position;
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        let rays_below = ((rays as f64 * RAYS_PER_STREAM).ceil() as u64).max(1);
        let lights: &[Illumination] = if is_lit { request.illuminations } else { &[] };
        let cosines = streams.cosines().iter();
        let sources = cosines.map(|cosine| (Source::Below(*cosine), rays_below));
        let sources = sources.chain(lights.iter().map(|light| (source(light), rays)));
        let first = self.tasks.len();
        self.tasks.extend(sources.map(|(source, rays)| WalkTask {
            kind: RegionKind::Boundary,
            sections: sections.clone(),
            edges: [Edge::Plane, Edge::Open],
            source,
            moments: streams.count(),
            rays,
            planes_m: Vec::new(),
        }));
        self.boundary_layers.push(BoundaryLayer {
            first,
            is_lit,
            layer: sections.last().map_or(0, |section| section.layer),
            sections,
        });
        self.boundary_layers.len() - 1
    }

    /// The position of the interface with these `sections`, which is added if it is
    /// not in the plan yet.
    fn interface(&mut self, request: &Request, streams: &Streams, sections: Vec<Section>) -> usize {
        let mut interfaces = self.interfaces.iter();
        if let Some(position) = interfaces.position(|interface| interface.sections == sections) {
            return position;
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        let rays = ((rays as f64 * RAYS_PER_INTERFACE_STREAM).ceil() as u64).max(1);
        let cosines = || streams.cosines().iter().copied();
        let sources = cosines()
            .map(Source::Over)
            .chain(cosines().map(Source::Below));
        let first = self.tasks.len();
        self.tasks.extend(sources.map(|source| WalkTask {
            kind: RegionKind::Interface,
            sections: sections.clone(),
            edges: [Edge::Open; 2],
            source,
            moments: streams.count(),
            rays,
            planes_m: Vec::new(),
        }));
        self.interfaces.push(LayerInterface { first, sections });
        self.interfaces.len() - 1
    }
}
