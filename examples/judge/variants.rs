//! The variants of the model: options, and shapes and facetness of the grains, which were not
//! measured.
use splitsnow::grain::{
    Facets, GrainType, Shape, SizeConversion, SizeLaw, SizeMeasure, SizeRange, TruncatedNormal,
};
use splitsnow::transport::{Entry, Model, Snow};
use splitsnow::units::um_to_m;

/// Options of the model, and grains of any size.
pub(crate) struct Variant {
    /// Name in tables.
    pub(crate) name: String,
    /// Model options.
    pub(crate) model: Model,
    size_law: SizeLaw,
    shape: Shape,
    proportion: TruncatedNormal,
    facetness: TruncatedNormal,
}

/// A truncated normal distribution about `mean`, half as wide as its range.
fn law(mean: f64, half_width: f64, [least, most]: [f64; 2]) -> TruncatedNormal {
    let (min, max) = (mean - half_width, mean + half_width);
    TruncatedNormal::new(min.max(least), max.min(most), mean, 0.5 * half_width).unwrap()
}

/// The representative sample of Varsa 2025, section 7.1, with model options.
fn representative(name: &str, facets: Facets, entry: Entry, size_law: SizeLaw) -> Variant {
    Variant {
        name: name.to_owned(),
        model: Model {
            facets,
            entry,
            ..Model::default()
        },
        size_law,
        shape: Shape::Spheroid,
        proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
    }
}

/// Four sets of options with the representative grains.
pub(crate) fn options() -> Vec<Variant> {
    let consistent = SizeLaw::Consistent;
    vec![
        representative(
            "varsa2025",
            Facets::Varsa2025,
            Entry::Uniform,
            SizeLaw::Varsa2025,
        ),
        representative(
            "varsa2025, projected",
            Facets::Varsa2025,
            Entry::Projected,
            consistent,
        ),
        representative(
            "visible, projected",
            Facets::Visible,
            Entry::Projected,
            consistent,
        ),
        measured(),
    ]
}

fn measured() -> Variant {
    representative(
        "measured",
        Facets::VGroove,
        Entry::Projected,
        SizeLaw::Consistent,
    )
}

/// The options of the preset `measured` with other grains.
pub(crate) fn grains() -> Vec<Variant> {
    let variant = |name: &str, shape: Shape, [mean, width]: [f64; 2], facetness: f64| Variant {
        name: format!("measured: {name}, F {facetness}"),
        shape,
        proportion: law(
            mean,
            width,
            match shape.has_aspect_ratio() {
                true => [0.02, 50.0],
                false => [0.05, 1.0],
            },
        ),
        facetness: law(facetness, facetness.min(0.1), [0.0, 1.0]),
        ..measured()
    };
    let (prolate, oblate, hexagonal) = (Shape::Spheroid, Shape::Oblate, Shape::Hexagonal);
    vec![
        variant("spheres", prolate, [0.95, 0.05], 1.0),
        variant("prolate .65", prolate, [0.65, 0.15], 0.0),
        variant("prolate .65", prolate, [0.65, 0.15], 0.3),
        variant("prolate .5", prolate, [0.5, 0.1], 0.0),
        variant("prolate .5", prolate, [0.5, 0.1], 0.3),
        variant("prolate .5", prolate, [0.5, 0.1], 1.0),
        variant("oblate .5", oblate, [0.5, 0.1], 0.0),
        variant("plates .3", hexagonal, [0.3, 0.1], 0.3),
        variant("plates .3", hexagonal, [0.3, 0.1], 0.7),
        variant("columns 1", hexagonal, [1.0, 0.3], 0.3),
        variant("columns 1", hexagonal, [1.0, 0.3], 0.7),
        variant("columns 4", hexagonal, [4.0, 1.0], 0.5),
    ]
}

/// Smooth spheres with the options of each preset.
pub(crate) fn spheres() -> Vec<Variant> {
    let [published, .., measured] = <[Variant; 4]>::try_from(options()).ok().unwrap();
    [published, measured]
        .map(|variant| Variant {
            proportion: TruncatedNormal::new(1.0, 1.0, 1.0, 0.0).unwrap(),
            facetness: TruncatedNormal::new(0.0, 0.0, 0.0, 0.0).unwrap(),
            ..variant
        })
        .into()
}

impl Variant {
    /// Dry snow of grains of one size, which gives the optical radius.
    pub(crate) fn snow(&self, radius_um: f64, density_kg_m3: f64, temperature_c: f64) -> Snow {
        let conversion = SizeConversion {
            half_width_um: 0.0,
            size_law: self.size_law,
            shape: self.shape,
            proportion: self.proportion,
            temperature_c,
        };
        let size_um = SizeMeasure::OpticalRadius.size_um(radius_um, &conversion);
        let grain = self.grain([size_um, size_um], self.facetness);
        Snow::dry(grain, density_kg_m3, temperature_c)
    }

    /// Grains of a range of lengths in um.
    pub(crate) fn grain(&self, [min, max]: [f64; 2], facetness: TruncatedNormal) -> GrainType {
        GrainType {
            size: SizeRange::new(um_to_m(min), um_to_m(max))
                .unwrap()
                .with_law(self.size_law),
            facetness,
            shape: self.shape,
            proportion: self.proportion,
        }
    }

    /// Grains of a range of lengths in um, and the facetness of the variant.
    pub(crate) fn sized(&self, lengths_um: [f64; 2]) -> GrainType {
        self.grain(lengths_um, self.facetness)
    }
}
