//! Number formats of the coefficients in a compact file.

/// Number format of the coefficients in a file. Bases are always f32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// 32-bit floating point.
    #[default]
    F32,
    /// 16-bit floating point.
    F16,
    /// 8- or 16-bit integers, evenly spaced from the smallest to the largest coefficient
    /// of a component.
    Quantised,
}

impl Precision {
    /// All variants.
    pub const ALL: [Self; 3] = [Self::F32, Self::F16, Self::Quantised];

    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Quantised => "quantised",
        }
    }
}

/// The coefficient `offset + step * integer`, computed in f64 and rounded to f32.
#[must_use]
pub fn dequantised(offset: f32, step: f32, integer: u16) -> f32 {
    (f64::from(offset) + f64::from(step) * f64::from(integer)) as f32
}

/// The value of a 16-bit float (IEEE 754 binary16) from its bits.
pub(crate) fn f16_to_f32(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f32::from(bits & 0x3ff));
    sign * match (exponent, bits & 0x3ff) {
        (0x1f, 0) => f32::INFINITY,
        (0x1f, _) => f32::NAN,
        // subnormals are multiples of 2^-24
        (0, _) => fraction / 16_777_216.0,
        _ => (1.0 + fraction / 1024.0) * f32::from_bits(((exponent + 112) as u32) << 23),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f16_matches_the_crate_half() {
        for bits in 0..=u16::MAX {
            let (ours, theirs) = (f16_to_f32(bits), half::f16::from_bits(bits).to_f32());
            assert!(
                ours == theirs && ours.is_sign_negative() == theirs.is_sign_negative()
                    || ours.is_nan() && theirs.is_nan(),
                "{bits:#x}: {ours} {theirs}"
            );
        }
    }
}
