//! Snowpacks whose grain events are drawn from tables.
use crate::table::PackedTable;
use crate::transport::{EXPONENTS, Entry, Model, Snow, diffuse_cosine, impurities_per_m};

/// A snowpack, or the part of one next to a plane.
#[derive(Debug, Clone)]
pub struct TableSnowpack<'a> {
    pub(super) layers: Vec<TableLayer<'a>>,
    /// Whether any layer contains water.
    pub(super) wet: bool,
    /// Whether any layer contains carbon.
    pub(super) sooty: bool,
    /// Number of different exponents of its impurities.
    pub(super) exponents: usize,
}

/// A layer of a [`TableSnowpack`].
#[derive(Debug, Clone)]
pub struct TableLayer<'a> {
    /// The types of grain, at least one.
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
    /// Absorption by the impurities of each exponent in ice and in pores, 1/m.
    pub(super) in_ice: [f64; EXPONENTS],
    pub(super) in_pores: [f64; EXPONENTS],
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
    /// `snow` down to `base_m` above the base of its snowpack, whose impurities have these
    /// `exponents`. `tables` holds the outcomes of each grain type in air and in water.
    #[must_use]
    pub fn new(
        snow: &Snow,
        base_m: f64,
        model: &Model,
        exponents: &[f64],
        tables: &[[&'a PackedTable; 2]],
    ) -> Self {
        let mut before = 0.0;
        let shares = snow.meeting_shares();
        let kinds = snow.grains.iter().zip(tables).zip(shares);
        let kinds = kinds.map(|((component, tables), share)| {
            let size = &component.grain.size;
            let kind = Kind {
                tables: *tables,
                size_m: [size.min_m(), size.max_m()],
                chance: [before, share],
            };
            before += share;
            kind
        });
        let [in_ice, in_pores] = impurities_per_m(snow, model, exponents);
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
    /// A snowpack of these layers, from the surface down (at least one), whose impurities
    /// have this number of different exponents.
    #[must_use]
    pub fn new(layers: Vec<TableLayer<'a>>, exponents: usize) -> Self {
        let clean = [0.0; EXPONENTS];
        Self {
            wet: layers.iter().any(|s| s.water_saturation > 0.0),
            sooty: layers
                .iter()
                .any(|s| s.in_ice != clean || s.in_pores != clean),
            exponents,
            layers,
        }
    }

    /// A snowpack of one clean layer with one type of grain. `tables` holds its outcomes in
    /// air and in water.
    #[must_use]
    pub fn plain(snow: &Snow, tables: [&'a PackedTable; 2]) -> Self {
        let model = Model::default();
        let layer = TableLayer::new(snow, 0.0, &model, &[], &[tables]);
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
