//! The lane types: arrays whose operations an instruction set performs.
use std::marker::PhantomData;
use std::ops::{
    Add, AddAssign, BitAnd, BitAndAssign, BitOr, BitOrAssign, BitXor, BitXorAssign, Div, Mul,
    MulAssign, Neg, Not, Shl, Shr, Sub, SubAssign,
};

use super::{Portable, Simd};

macro_rules! lanes {
    ($(#[$doc:meta])* $name:ident, $scalar:ty, $lanes:literal, $align:literal, $zero:literal, $one:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[repr(C, align($align))]
        pub struct $name<S: Simd = Portable>(pub(super) [$scalar; $lanes], PhantomData<S>);

        impl<S: Simd> Default for $name<S> {
            #[inline(always)]
            fn default() -> Self {
                Self::ZERO
            }
        }

        impl<S: Simd> $name<S> {
            /// 0 in all lanes.
            pub const ZERO: Self = Self::splat($zero);
            /// 1 in all lanes.
            pub const ONE: Self = Self::splat($one);

            /// These numbers.
            #[inline(always)]
            #[must_use]
            pub const fn new(lanes: [$scalar; $lanes]) -> Self {
                Self(lanes, PhantomData)
            }

            /// One number in all lanes.
            #[inline(always)]
            #[must_use]
            pub const fn splat(value: $scalar) -> Self {
                Self::new([value; $lanes])
            }

            /// The numbers.
            #[inline(always)]
            #[must_use]
            pub const fn to_array(self) -> [$scalar; $lanes] {
                self.0
            }

            /// The numbers.
            #[inline(always)]
            #[must_use]
            pub const fn as_array(&self) -> &[$scalar; $lanes] {
                &self.0
            }

            /// The numbers, to be changed.
            #[inline(always)]
            #[must_use]
            pub const fn as_mut_array(&mut self) -> &mut [$scalar; $lanes] {
                &mut self.0
            }

            /// The same numbers for another instruction set.
            #[inline(always)]
            #[must_use]
            pub const fn on<T: Simd>(self) -> $name<T> {
                $name::new(self.0)
            }
        }
    };
}

lanes!(
    /// Eight f64, or eight masks: a mask is an f64 with all bits set, or none.
    F64x8, f64, 8, 64, 0.0, 1.0
);
lanes!(
    /// Four f64.
    F64x4, f64, 4, 32, 0.0, 1.0
);
lanes!(
    /// Eight f32.
    F32x8, f32, 8, 32, 0.0, 1.0
);
lanes!(
    /// Eight u64; sums and differences wrap.
    U64x8, u64, 8, 64, 0, 1
);

macro_rules! operators {
    ($name:ident: $($op:ident $f:ident by $by:ident, $assign:ident $g:ident;)*) => {$(
        impl<S: Simd> $op for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, other: Self) -> Self {
                Self::new(S::$by(self.0, other.0))
            }
        }

        impl<S: Simd> $assign for $name<S> {
            #[inline(always)]
            fn $g(&mut self, other: Self) {
                *self = $op::$f(*self, other);
            }
        }
    )*};
}

operators!(F64x8:
    Add add by add, AddAssign add_assign;
    Sub sub by sub, SubAssign sub_assign;
    Mul mul by mul, MulAssign mul_assign;
    BitAnd bitand by and, BitAndAssign bitand_assign;
    BitOr bitor by or, BitOrAssign bitor_assign;
    BitXor bitxor by xor, BitXorAssign bitxor_assign;
);
operators!(F64x4:
    Add add by add_4, AddAssign add_assign;
    Sub sub by sub_4, SubAssign sub_assign;
    Mul mul by mul_4, MulAssign mul_assign;
);
operators!(F32x8:
    Add add by add_single, AddAssign add_assign;
    Mul mul by mul_single, MulAssign mul_assign;
);
operators!(U64x8:
    Add add by add_integers, AddAssign add_assign;
    Sub sub by sub_integers, SubAssign sub_assign;
    BitAnd bitand by and_integers, BitAndAssign bitand_assign;
    BitOr bitor by or_integers, BitOrAssign bitor_assign;
    BitXor bitxor by xor_integers, BitXorAssign bitxor_assign;
);

impl<S: Simd> Div for F64x8<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self::new(S::div(self.0, other.0))
    }
}

impl<S: Simd> Neg for F64x8<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self ^ Self::splat(-0.0)
    }
}

impl<S: Simd> Not for F64x8<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        self ^ Self::ALL
    }
}

impl<S: Simd> Shl<u32> for U64x8<S> {
    type Output = Self;
    #[inline(always)]
    fn shl(self, bits: u32) -> Self {
        Self::new(S::shl(self.0, bits))
    }
}

impl<S: Simd> Shr<u32> for U64x8<S> {
    type Output = Self;
    #[inline(always)]
    fn shr(self, bits: u32) -> Self {
        Self::new(S::shr(self.0, bits))
    }
}

/// Comparisons and selections.
impl<S: Simd> F64x8<S> {
    /// A mask that is set in all lanes.
    pub const ALL: Self = Self::splat(f64::from_bits(u64::MAX));

    /// The mask of `set`, for one lane.
    #[inline(always)]
    #[must_use]
    pub const fn mask(set: bool) -> f64 {
        f64::from_bits(if set { u64::MAX } else { 0 })
    }

    /// The columns of eight rows: lane i of column j is number j of row i.
    #[inline(always)]
    #[must_use]
    pub fn columns(rows: [&[f32; 8]; 8]) -> [Self; 8] {
        S::columns(rows).map(Self::new)
    }

    /// Square roots.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        Self::new(S::sqrt(self.0))
    }

    /// Absolute values.
    #[inline(always)]
    #[must_use]
    pub fn abs(self) -> Self {
        self & Self::splat(f64::from_bits(u64::MAX >> 1))
    }

    /// `self` where it is larger, else `other`: `other` where one is NaN.
    #[inline(always)]
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self::new(S::max(self.0, other.0))
    }

    /// `self` where it is smaller, else `other`: `other` where one is NaN.
    #[inline(always)]
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        Self::new(S::min(self.0, other.0))
    }

    /// The mask of `self < other`.
    #[inline(always)]
    #[must_use]
    pub fn lt(self, other: Self) -> Self {
        Self::new(S::lt(self.0, other.0))
    }

    /// The mask of `self <= other`.
    #[inline(always)]
    #[must_use]
    pub fn le(self, other: Self) -> Self {
        Self::new(S::le(self.0, other.0))
    }

    /// The mask of `self > other`.
    #[inline(always)]
    #[must_use]
    pub fn gt(self, other: Self) -> Self {
        other.lt(self)
    }

    /// The mask of `self >= other`.
    #[inline(always)]
    #[must_use]
    pub fn ge(self, other: Self) -> Self {
        other.le(self)
    }

    /// The mask of `self == other`.
    #[inline(always)]
    #[must_use]
    pub fn equals(self, other: Self) -> Self {
        Self::new(S::equals(self.0, other.0))
    }

    /// Where the mask `self` is set `yes`, else `no`.
    #[inline(always)]
    #[must_use]
    pub fn select(self, yes: Self, no: Self) -> Self {
        Self::new(S::select(self.0, yes.0, no.0))
    }

    /// A bit for each lane of the mask `self`.
    #[inline(always)]
    #[must_use]
    pub fn to_bitmask(self) -> u32 {
        S::bitmask(self.0)
    }

    /// Whether the mask is set in any lane.
    #[inline(always)]
    #[must_use]
    pub fn any(self) -> bool {
        self.to_bitmask() != 0
    }

    /// The bits of the numbers.
    #[inline(always)]
    #[must_use]
    pub fn to_bits(self) -> U64x8<S> {
        let mut bits = [0; 8];
        for (bits, value) in bits.iter_mut().zip(self.0) {
            *bits = value.to_bits();
        }
        U64x8::new(bits)
    }

    /// The numbers of these bits.
    #[inline(always)]
    #[must_use]
    pub fn from_bits(bits: U64x8<S>) -> Self {
        let mut values = [0.0; 8];
        for (value, bits) in values.iter_mut().zip(bits.0) {
            *value = f64::from_bits(bits);
        }
        Self::new(values)
    }
}
