//! The primaries of linear colours, their white points (chromaticities x, y), and the matrices
//! between them. White is adapted by Bradford's matrix.
use nalgebra::{Matrix3, Vector3};

/// Chromaticity of the white of D65.
const D65: [f64; 2] = [0.3127, 0.3290];
/// Cone responses of Bradford's adaptation, from X, Y and Z.
const BRADFORD: Matrix3<f64> = Matrix3::new(
    0.8951, 0.2664, -0.1614, //
    -0.7502, 1.7135, 0.0367, //
    0.0389, -0.0685, 1.0296,
);

/// The primaries of a linear colour space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primaries {
    /// Rec.709, those of sRGB.
    Rec709,
    /// DCI-P3 with white D65, as Display P3.
    P3,
    /// Rec.2020.
    Rec2020,
    /// `ACEScg`: AP1 with the white of ACES.
    AcesCg,
    /// X, Y and Z.
    Xyz,
}

impl Primaries {
    /// All primaries.
    pub const ALL: [Self; 5] = [
        Self::AcesCg,
        Self::Rec709,
        Self::P3,
        Self::Rec2020,
        Self::Xyz,
    ];

    /// Name on the command line and in sidecars.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rec709 => "rec709",
            Self::P3 => "p3",
            Self::Rec2020 => "rec2020",
            Self::AcesCg => "acescg",
            Self::Xyz => "xyz",
        }
    }

    /// The chromaticities x, y of red, green, blue and white.
    #[must_use]
    pub const fn chromaticities(self) -> [[f64; 2]; 4] {
        match self {
            Self::Rec709 => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65],
            Self::P3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65],
            Self::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
            Self::AcesCg => [
                [0.713, 0.293],
                [0.165, 0.830],
                [0.128, 0.044],
                [0.32168, 0.33767],
            ],
            Self::Xyz => [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], D65],
        }
    }

    /// The matrix from X, Y and Z, whose white is D65 with Y = 1, to these primaries. If their
    /// white is another, X, Y and Z are adapted to it first (Bradford), as ACES does.
    pub(super) fn matrix(self) -> Matrix3<f64> {
        if self == Self::Xyz {
            return Matrix3::identity();
        }
        let [red, green, blue, white] = self.chromaticities().map(xyz);
        let primaries = Matrix3::from_columns(&[red, green, blue]);
        let inverse = inverse(&primaries);
        // scaled so that white becomes (1, 1, 1)
        let scale = (inverse * white).map(f64::recip);
        let to_rgb = Matrix3::from_diagonal(&scale) * inverse;
        let (from, to) = (BRADFORD * white_xyz(), BRADFORD * white);
        let gain = Matrix3::from_diagonal(&to.component_div(&from));
        to_rgb * self::inverse(&BRADFORD) * gain * BRADFORD
    }

    /// The matrix from these primaries to those of `other`.
    pub(super) fn to(self, other: Self) -> Matrix3<f64> {
        other.matrix() * inverse(&self.matrix())
    }
}

/// X, Y and Z of D65, Y = 1.
pub(super) fn white_xyz() -> Vector3<f64> {
    xyz(D65)
}

/// X, Y and Z of a chromaticity, Y = 1; of blue X, Y and Z = 0, 0, 1.
fn xyz([x, y]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(x, y, 1.0 - x - y) / if y == 0.0 { 1.0 } else { y }
}

/// The inverse of a matrix of linearly independent colours.
pub(super) fn inverse(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    matrix.try_inverse().unwrap_or_else(Matrix3::identity)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Matrices as published: IEC 61966-2-1 (four decimals); Academy TB-2014-004 for AP1 with
    /// Bradford's adaptation from D65 as in the ACES transforms.
    #[test]
    fn matrices_are_the_published_ones() {
        let srgb = Matrix3::new(
            3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570,
        );
        assert!((Primaries::Rec709.matrix() - srgb).abs().max() < 4e-4);
        let rec709_to_acescg = Matrix3::new(
            0.613_097, 0.339_523, 0.047_379, 0.070_194, 0.916_354, 0.013_452, 0.020_616, 0.109_570,
            0.869_815,
        );
        let found = Primaries::Rec709.to(Primaries::AcesCg);
        assert!((found - rec709_to_acescg).abs().max() < 2e-5, "{found}");
        let rec2020 = Matrix3::new(
            1.716_651, -0.355_671, -0.253_366, -0.666_684, 1.616_481, 0.015_769, 0.017_640,
            -0.042_771, 0.942_103,
        );
        let found = Primaries::Rec2020.matrix();
        assert!((found - rec2020).abs().max() < 2e-5, "{found}");
    }

    #[test]
    fn white_is_white_in_all_primaries() {
        for primaries in Primaries::ALL {
            let white = primaries.matrix() * white_xyz();
            let expected = match primaries {
                Primaries::Xyz => white_xyz(),
                _ => Vector3::repeat(1.0),
            };
            assert!((white - expected).abs().max() < 1e-12, "{primaries:?}");
            let there = primaries.to(Primaries::Rec709) * Primaries::Rec709.to(primaries);
            assert!((there - Matrix3::identity()).abs().max() < 1e-12);
        }
    }
}
