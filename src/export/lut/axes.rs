//! The axes of a table: from physical values to places in the image and back.

/// Thicknesses, evenly spaced in their fourth root: thin snow darkens fast, thick snow slowly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepthAxis {
    pub(super) ends_cm: [f64; 2],
    pub(super) count: usize,
}

impl DepthAxis {
    pub(super) fn new(ends_cm: [f64; 2], count: usize) -> Self {
        Self { ends_cm, count }
    }

    fn place(cm: f64) -> f64 {
        cm.sqrt().sqrt()
    }

    /// The thickness at a distance in texels from the centre of the first.
    pub(super) fn value(&self, texel: f64) -> f64 {
        let [first, last] = self.ends_cm.map(Self::place);
        let place = first + (last - first) * texel / (self.count - 1) as f64;
        (place * place * place * place).clamp(self.ends_cm[0], self.ends_cm[1])
    }

    /// The thicknesses at the centres of texels.
    pub(super) fn values(&self) -> Vec<f64> {
        (0..self.count).map(|i| self.value(i as f64)).collect()
    }

    /// Scale and offset from the fourth root of the thickness to the coordinate in the image, 0 to 1.
    pub(super) fn coordinate(&self) -> [f64; 2] {
        coordinate(self.ends_cm.map(Self::place), self.count)
    }
}

/// Cosines, evenly spaced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CosineAxis {
    /// Of the most oblique and of the steepest direction.
    pub(super) ends: [f64; 2],
    pub(super) count: usize,
}

impl CosineAxis {
    pub(super) fn new([first_deg, last_deg]: [f64; 2], count: usize) -> Self {
        let ends = if first_deg == last_deg {
            // the same for all directions
            [0.0, 1.0]
        } else {
            [last_deg, first_deg].map(|deg| deg.to_radians().cos())
        };
        Self { ends, count }
    }

    pub(super) fn value(&self, texel: f64) -> f64 {
        let [first, last] = self.ends;
        first + (last - first) * texel / (self.count - 1) as f64
    }

    pub(super) fn values(&self) -> Vec<f64> {
        (0..self.count).map(|i| self.value(i as f64)).collect()
    }

    /// Scale and offset from the cosine to the coordinate in the image, 0 to 1.
    pub(super) fn coordinate(&self) -> [f64; 2] {
        coordinate(self.ends, self.count)
    }
}

/// Scale and offset by which `ends` become the centres of the first and the last of `count`
/// texels, in parts of the image.
fn coordinate([first, last]: [f64; 2], count: usize) -> [f64; 2] {
    let texels = count as f64;
    let scale = (texels - 1.0) / texels / (last - first);
    [scale, 0.5 / texels - first * scale]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_centres_of_texels() {
        let depth = DepthAxis::new([0.3, 60.0], 17);
        let values = depth.values();
        let ends = (values[0] / 0.3, values[16] / 60.0);
        assert!((ends.0 - 1.0).abs() < 1e-12 && (ends.1 - 1.0).abs() < 1e-12);
        let [scale, offset] = depth.coordinate();
        for (i, cm) in values.iter().enumerate() {
            let centre = (i as f64 + 0.5) / 17.0;
            assert!((scale * cm.powf(0.25) + offset - centre).abs() < 1e-12);
        }
        let cosine = CosineAxis::new([0.0, 85.0], 4);
        let [scale, offset] = cosine.coordinate();
        for (i, value) in cosine.values().iter().enumerate() {
            assert!((scale * value + offset - (i as f64 + 0.5) / 4.0).abs() < 1e-12);
        }
        assert_eq!(cosine.ends[1], 1.0);
        assert_eq!(CosineAxis::new([20.0, 20.0], 2).ends, [0.0, 1.0]);
    }
}
