//! Snowpacks whose grain events are drawn from tables.
use crate::table::PackedTable;
use crate::transport::{Entry, Model, Snow, TRACERS, Tracers, diffuse_cosine};

/// A snowpack, or the part of one next to a plane.
#[derive(Debug, Clone)]
pub struct TableSnowpack<'a> {
    pub(super) layers: Vec<TableLayer<'a>>,
    /// Whether any layer contains water.
    pub(super) wet: bool,
    /// Whether any layer contains impurities.
    pub(super) sooty: bool,
    /// Number of sums over its impurities.
    pub(super) tracers: usize,
}

/// A layer of a [`TableSnowpack`].
#[derive(Debug, Clone)]
pub struct TableLayer<'a> {
    /// The types of grain, at least one, and particles.
    pub(super) kinds: Vec<Kind<'a>>,
    /// Mean free distance between grains, m.
    pub(super) mean_free_distance_m: f64,
    /// Fraction of the pore space that is water.
    pub(super) water_saturation: f64,
    /// Height of its lower plane above the base of the snowpack, m.
    pub(super) base_m: f64,
    /// Longest grain, m.
    longest_m: f64,
    entry: Entry,
    /// What a metre in ice and in pores adds to the sums over impurities.
    pub(super) in_ice: [f64; TRACERS],
    pub(super) in_pores: [f64; TRACERS],
}

/// A type of grain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind<'a> {
    /// Outcomes in air and (in wet snow) in water.
    pub(super) tables: [&'a PackedTable; 2],
    /// Smallest and largest grain, m.
    pub(super) size_m: [f64; 2],
    /// Probabilities that a grain met is of an earlier type and of this type.
    pub(super) chance: [f64; 2],
}

impl<'a> TableLayer<'a> {
    /// `snow` down to `base_m` above the base of its snowpack, with the sums `tracers` over impurities.
    /// `tables` holds the outcomes of each grain type in air and in water, and then of particles
    /// that scatter, if there are any.
    #[must_use]
    pub fn new(
        snow: &Snow,
        base_m: f64,
        model: &Model,
        tracers: &Tracers,
        tables: &[[&'a PackedTable; 2]],
    ) -> Self {
        let mut before = 0.0;
        let shares = snow.meeting_shares();
        let kinds = snow.sizes_by_type_m().zip(tables).zip(shares);
        let kinds = kinds.map(|((size_m, tables), share)| {
            let kind = Kind {
                tables: *tables,
                size_m,
                chance: [before, share],
            };
            before += share;
            kind
        });
        let [in_ice, in_pores] = tracers.per_m(snow, model);
        Self {
            kinds: kinds.collect(),
            mean_free_distance_m: snow.mean_free_distance_m(),
            water_saturation: snow.water_saturation,
            base_m,
            longest_m: snow.sizes_m()[1],
            entry: model.entry,
            in_ice,
            in_pores,
        }
    }
}

impl<'a> TableSnowpack<'a> {
    /// A snowpack of these layers, from the surface down (at least one), with this number
    /// of sums over impurities.
    #[must_use]
    pub fn new(layers: Vec<TableLayer<'a>>, tracers: usize) -> Self {
        let clean = [0.0; TRACERS];
        Self {
            wet: layers.iter().any(|s| s.water_saturation > 0.0),
            sooty: layers
                .iter()
                .any(|s| s.in_ice != clean || s.in_pores != clean),
            tracers,
            layers,
        }
    }

    /// A snowpack of one clean layer with one type of grain. `tables` holds its outcomes in
    /// air and in water.
    #[must_use]
    pub fn plain(snow: &Snow, tables: [&'a PackedTable; 2]) -> Self {
        let model = Model::default();
        let layer = TableLayer::new(snow, 0.0, &model, &Tracers::Laws(Vec::new()), &[tables]);
        Self::new(vec![layer], 0)
    }

    /// Whether the snowpack is one layer with one type of grain.
    pub(super) fn is_plain(&self) -> bool {
        self.layers.len() == 1 && self.layers[0].kinds.len() == 1
    }

    /// Longest grain, m.
    pub(super) fn longest_m(&self) -> f64 {
        self.layers.iter().map(|s| s.longest_m).fold(0.0, f64::max)
    }

    /// See [`diffuse_cosine`].
    pub(super) fn diffuse_cosine(&self, u: f64) -> f64 {
        let surface = &self.layers[0];
        diffuse_cosine(
            u,
            surface.entry,
            surface.mean_free_distance_m,
            surface.longest_m,
        )
    }
}
