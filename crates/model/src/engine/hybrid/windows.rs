//! Windows: parts of a snowpack that are walked to count light at planes inside them.
//!
//! The streams in the bulk are those of point scatterers. They carry the same power and are
//! absorbed in the same places as the light of the model, but a grain displaces light, and its way
//! is longer than the mean free path between points. So light is counted in walks everywhere:
//!
//! - A window around each boundary layer and each walked part of the inside reaches two
//!   [`margin_m`] into the bulk. It serves the depths up to one margin from its open ends, where
//!   its walks are still those of points.
//! - In the bulk further away, one window per layer, of one margin above and below the plane,
//!   serves all depths.
//!
//! The streams that enter a window at its open ends are those of the snowpack there.
use super::plan::{
    LayerInterface, RegionKind, Slab, ThickSlab, WalkPlan, WalkTask, depth_m, needed_m, source,
};
use super::planes::Segment;
use super::{RAYS_PER_INTERFACE_STREAM, RAYS_PER_STREAM};
use crate::engine::Request;
use crate::engine::tables::{PARTS, Section, sections};
use crate::slab::Streams;
use crate::table::{Edge, Source};
use crate::transport::Snow;

/// A window and the depths that it serves.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// Depths of its ends, m.
    pub(super) ends_m: [f64; 2],
    pub(super) edges: [Edge; 2],
    /// Numbers of the layers at its ends.
    pub(super) layers: [usize; 2],
    /// The depths that it serves, m. Its planes are there, and at its ends.
    pub(super) depths_m: Vec<f64>,
    /// Position of its first task: one for the illumination, or one per stream at an open upper
    /// end; and then one per stream at an open lower end.
    pub(super) first: usize,
}

/// A part of the snowpack and the depths in it that its window serves, m.
struct Zone {
    window_m: [f64; 2],
    serves_m: [f64; 2],
}

/// Distance within which an open end of a region affects its walks, m.
fn margin_m(snow: &Snow) -> f64 {
    needed_m(snow)
}

impl WalkPlan {
    /// Adds the walks that count light at `depths_m`, increasing, in the only snowpack of
    /// `request`.
    pub(super) fn windows(
        &mut self,
        request: &Request,
        streams: &Streams,
        depths_m: &[f64],
    ) -> Vec<Window> {
        let snows: Vec<&Snow> = request.snowpack.snows().collect();
        let thickness_m = request.thicknesses_m[0];
        let snowpack = sections(request, thickness_m);
        let zones = match &self.slabs[0] {
            Slab::Thin(_) => vec![Zone {
                window_m: [0.0, thickness_m],
                serves_m: [0.0, thickness_m],
            }],
            Slab::Thick(slab) => zones(slab, &self.interfaces, &snows, thickness_m),
        };
        let mut windows = Vec::new();
        let mut next = 0;
        for zone in zones {
            let [from_m, to_m] = zone.serves_m;
            // the bulk above it
            while next < depths_m.len() && depths_m[next] < from_m {
                let z_m = depths_m[next];
                let layer = layer_at(&snowpack, z_m);
                let margin_m = margin_m(snows[layer]);
                let section = Section {
                    layer,
                    thickness_m: 2.0 * margin_m,
                };
                let edges = [Edge::Open; 2];
                let planes_m = vec![0.0, margin_m, 2.0 * margin_m];
                let first = self.walks(request, streams, vec![section], edges, planes_m);
                windows.push(Window {
                    ends_m: [z_m - margin_m, z_m + margin_m],
                    edges,
                    layers: [layer; 2],
                    depths_m: vec![z_m],
                    first,
                });
                next += 1;
            }
            let is_last = to_m == thickness_m;
            let count = depths_m[next..]
                .iter()
                .take_while(|z_m| is_last || **z_m <= to_m)
                .count();
            if count == 0 {
                continue;
            }
            let depths_m = depths_m[next..next + count].to_vec();
            next += count;
            let [top_m, bottom_m] = zone.window_m;
            let planes_m = std::iter::once(&top_m).chain(&depths_m);
            let planes_m = planes_m.chain([&bottom_m]).map(|z_m| z_m - top_m);
            let planes_m = planes_m.collect();
            let edge = |is_plane: bool| if is_plane { Edge::Plane } else { Edge::Open };
            let edges = [edge(top_m == 0.0), edge(bottom_m == thickness_m)];
            let cut = between(&snowpack, zone.window_m);
            let layers = [cut.first(), cut.last()].map(|end| end.map_or(0, |s| s.layer));
            let first = self.walks(request, streams, cut, edges, planes_m);
            windows.push(Window {
                ends_m: zone.window_m,
                edges,
                layers,
                depths_m,
                first,
            });
        }
        windows
    }

    /// The position of the first of the walks through a window, which are added if they are not
    /// in the plan yet.
    fn walks(
        &mut self,
        request: &Request,
        streams: &Streams,
        sections: Vec<Section>,
        edges: [Edge; 2],
        planes_m: Vec<f64>,
    ) -> usize {
        let is_same = |task: &WalkTask| {
            task.kind == RegionKind::Window
                && (&task.sections, task.edges, &task.planes_m) == (&sections, edges, &planes_m)
        };
        if let Some(position) = self.tasks.iter().position(is_same) {
            return position;
        }
        let rays = request.rays.div_ceil(PARTS as u64);
        let per_stream = match edges {
            [Edge::Open, Edge::Open] => RAYS_PER_INTERFACE_STREAM,
            _ => RAYS_PER_STREAM,
        };
        let rays_inside = ((rays as f64 * per_stream).ceil() as u64).max(1);
        let streams = |source: fn(f64) -> Source| {
            let cosines = streams.cosines().iter();
            cosines.map(move |cosine| (source(*cosine), rays_inside))
        };
        let mut sources = Vec::new();
        match edges[0] {
            Edge::Plane => sources.push((source(&request.illuminations[0]), rays)),
            Edge::Open => sources.extend(streams(Source::Over)),
        }
        if edges[1] == Edge::Open {
            sources.extend(streams(Source::Below));
        }
        let first = self.tasks.len();
        self.tasks
            .extend(sources.into_iter().map(|(source, rays)| WalkTask {
                kind: RegionKind::Window,
                sections: sections.clone(),
                edges,
                source,
                moments: 1,
                rays,
                planes_m: planes_m.clone(),
            }));
        first
    }
}

/// The parts of a snowpack that are not far inside its bulk.
fn zones(
    slab: &ThickSlab,
    interfaces: &[LayerInterface],
    snows: &[&Snow],
    thickness_m: f64,
) -> Vec<Zone> {
    let mut zones = Vec::new();
    let (mut top_m, mut from_m) = (0.0, 0.0);
    let mut end_m = slab.upper_m;
    for segment in &slab.inside {
        let section = match segment {
            Segment::Walked(number) => {
                end_m += depth_m(&interfaces[*number].sections);
                continue;
            }
            Segment::Bulk(section) => section,
        };
        let margin_m = margin_m(snows[section.layer]);
        let lower_m = end_m + section.thickness_m;
        // a thin part of the bulk is walked with what is above and below it
        if section.thickness_m > 4.0 * margin_m {
            zones.push(Zone {
                window_m: [top_m, end_m + 2.0 * margin_m],
                serves_m: [from_m, end_m + margin_m],
            });
            (top_m, from_m) = (lower_m - 2.0 * margin_m, lower_m - margin_m);
        }
        end_m = lower_m;
    }
    zones.push(Zone {
        window_m: [top_m, thickness_m],
        serves_m: [from_m, thickness_m],
    });
    zones
}

/// The sections of `snowpack`, given downward, between two depths.
fn between(snowpack: &[Section], [top_m, bottom_m]: [f64; 2]) -> Vec<Section> {
    let mut from_m = 0.0;
    let cut = snowpack.iter().filter_map(|section| {
        let to_m = from_m + section.thickness_m;
        let thickness_m = bottom_m.min(to_m) - top_m.max(from_m);
        from_m = to_m;
        (thickness_m > 0.0).then_some(Section {
            thickness_m,
            ..*section
        })
    });
    cut.collect()
}

/// Number of the layer at a depth.
fn layer_at(snowpack: &[Section], z_m: f64) -> usize {
    let mut to_m = 0.0;
    let found = snowpack.iter().find(|section| {
        to_m += section.thickness_m;
        z_m < to_m
    });
    found.or(snowpack.last()).map_or(0, |section| section.layer)
}
