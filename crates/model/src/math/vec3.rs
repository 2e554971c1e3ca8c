//! A vector of three f64.
use std::ops::{Add, Mul, Neg, Sub};

/// A position or direction; z is the depth in the snow, downward.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3 {
    /// First horizontal component.
    pub x: f64,
    /// Second horizontal component.
    pub y: f64,
    /// Depth component.
    pub z: f64,
}

impl Vec3 {
    /// The vector (x, y, z).
    #[inline]
    #[must_use]
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// Scalar product.
    #[inline]
    #[must_use]
    pub fn dot(self, o: Self) -> f64 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// `self + s * o`.
    #[inline]
    #[must_use]
    pub fn plus(self, s: f64, o: Self) -> Self {
        Self::new(self.x + s * o.x, self.y + s * o.y, self.z + s * o.z)
    }

    /// Two unit vectors that complete this unit vector to an orthonormal frame
    /// (Duff et al. 2017, JCGT 6(1)).
    #[must_use]
    pub fn frame(self) -> (Self, Self) {
        let sign = 1f64.copysign(self.z);
        let a = -1.0 / (sign + self.z);
        let b = self.x * self.y * a;
        (
            Self::new(1.0 + sign * self.x * self.x * a, sign * b, -sign * self.x),
            Self::new(b, sign + self.y * self.y * a, -self.y),
        )
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    #[inline]
    fn mul(self, s: f64) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}
