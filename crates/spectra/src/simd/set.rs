//! What an instruction set does with arrays of lanes, and the entry into it.
use std::fmt::Debug;
use std::marker::PhantomData;

use super::{Level, level};

/// Keeps instruction sets to this crate: one may exist only where [`dispatch_at`] has
/// found that the processor has it.
pub(super) mod sealed {
    /// See [`super::Simd`].
    pub trait Sealed {}
}

macro_rules! each {
    ($name:ident, $scalar:ty, $lanes:literal, |$a:ident, $b:ident| $value:expr) => {
        /// Lane by lane.
        #[doc(hidden)]
        #[inline(always)]
        #[must_use]
        fn $name(a: [$scalar; $lanes], b: [$scalar; $lanes]) -> [$scalar; $lanes] {
            let mut out = a;
            for (out, b) in out.iter_mut().zip(b) {
                let ($a, $b) = (*out, b);
                *out = $value;
            }
            out
        }
    };
}

fn bits(set: bool) -> f64 {
    f64::from_bits(if set { u64::MAX } else { 0 })
}

/// An instruction set. The provided functions are loops over the lanes, which the compiler
/// turns into vector instructions as far as it can; those of x86 replace them.
pub trait Simd:
    sealed::Sealed + Copy + Default + Debug + PartialEq + Send + Sync + 'static
{
    /// Its level.
    const LEVEL: Level;

    /// Performs `task` in a function of its own, compiled for this instruction set. This
    /// keeps what is called at several places from being inlined into all of them.
    fn outlined<T: Task>(task: T) -> T::Output;

    each!(add, f64, 8, |a, b| a + b);
    each!(sub, f64, 8, |a, b| a - b);
    each!(mul, f64, 8, |a, b| a * b);
    each!(div, f64, 8, |a, b| a / b);
    each!(and, f64, 8, |a, b| f64::from_bits(
        a.to_bits() & b.to_bits()
    ));
    each!(or, f64, 8, |a, b| f64::from_bits(a.to_bits() | b.to_bits()));
    each!(xor, f64, 8, |a, b| f64::from_bits(
        a.to_bits() ^ b.to_bits()
    ));
    each!(max, f64, 8, |a, b| if a > b { a } else { b });
    each!(min, f64, 8, |a, b| if a < b { a } else { b });
    each!(lt, f64, 8, |a, b| bits(a < b));
    each!(le, f64, 8, |a, b| bits(a <= b));
    each!(equals, f64, 8, |a, b| bits(a == b));
    each!(add_4, f64, 4, |a, b| a + b);
    each!(sub_4, f64, 4, |a, b| a - b);
    each!(mul_4, f64, 4, |a, b| a * b);
    each!(add_single, f32, 8, |a, b| a + b);
    each!(mul_single, f32, 8, |a, b| a * b);
    each!(add_integers, u64, 8, |a, b| a.wrapping_add(b));
    each!(sub_integers, u64, 8, |a, b| a.wrapping_sub(b));
    each!(and_integers, u64, 8, |a, b| a & b);
    each!(or_integers, u64, 8, |a, b| a | b);
    each!(xor_integers, u64, 8, |a, b| a ^ b);

    /// Square roots.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn sqrt(a: [f64; 8]) -> [f64; 8] {
        a.map(f64::sqrt)
    }

    /// Where the mask is set `yes`, else `no`.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn select(mask: [f64; 8], yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        let mut out = no;
        for ((out, yes), mask) in out.iter_mut().zip(yes).zip(mask) {
            *out = if mask.is_sign_negative() { yes } else { *out };
        }
        out
    }

    /// The columns of eight rows.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn columns(rows: [&[f32; 8]; 8]) -> [[f64; 8]; 8] {
        let mut columns = [[0.0; 8]; 8];
        for (lane, row) in rows.into_iter().enumerate() {
            for (column, value) in columns.iter_mut().zip(row) {
                column[lane] = f64::from(*value);
            }
        }
        columns
    }

    /// The signs.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn bitmask(mask: [f64; 8]) -> u32 {
        let mut out = 0;
        for (lane, value) in mask.iter().enumerate() {
            out |= ((value.to_bits() >> 63) as u32) << lane;
        }
        out
    }

    /// To the left.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn shl(a: [u64; 8], bits: u32) -> [u64; 8] {
        a.map(|a| a << bits)
    }

    /// To the right.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    fn shr(a: [u64; 8], bits: u32) -> [u64; 8] {
        a.map(|a| a >> bits)
    }
}

/// The instructions that every processor of the target has: SSE2 on x86, NEON on aarch64.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Portable;

impl sealed::Sealed for Portable {}

#[cfg(not(target_arch = "x86_64"))]
impl Simd for Portable {
    const LEVEL: Level = if cfg!(target_arch = "aarch64") {
        Level::Neon
    } else {
        Level::Portable
    };

    #[inline(never)]
    fn outlined<T: Task>(task: T) -> T::Output {
        task.perform()
    }
}

/// Work that is compiled for every instruction set.
pub trait SimdKernel {
    /// What it gives.
    type Output;

    /// The work. `#[inline(always)]` in every implementation, as everything it calls.
    fn run<S: Simd>(self) -> Self::Output;
}

/// A part of a kernel: a call of a function with its arguments. Not a closure, as the
/// compiler may leave a closure as a function without the instruction set.
pub trait Task {
    /// What the function gives.
    type Output;

    /// Calls the function. `#[inline(always)]` in every implementation.
    fn perform(self) -> Self::Output;
}

/// A kernel for an instruction set.
struct On<K, S>(K, PhantomData<S>);

impl<K: SimdKernel, S: Simd> Task for On<K, S> {
    type Output = K::Output;

    #[inline(always)]
    fn perform(self) -> K::Output {
        self.0.run::<S>()
    }
}

/// Runs `kernel` with the instruction set in use ([`level`]).
#[inline]
pub fn dispatch<K: SimdKernel>(kernel: K) -> K::Output {
    enter(level(), kernel)
}

/// Runs `kernel` with the instruction set of `level`; `None` if it is not supported.
pub fn dispatch_at<K: SimdKernel>(level: Level, kernel: K) -> Option<K::Output> {
    level.is_supported().then(|| enter(level, kernel))
}

/// Runs `kernel` at a level that is supported.
#[inline]
fn enter<K: SimdKernel>(level: Level, kernel: K) -> K::Output {
    match level {
        #[cfg(target_arch = "x86_64")]
        Level::V4 => super::x86::V4::outlined(On::<K, super::x86::V4>(kernel, PhantomData)),
        #[cfg(target_arch = "x86_64")]
        Level::V3 => super::x86::V3::outlined(On::<K, super::x86::V3>(kernel, PhantomData)),
        _ => Portable::outlined(On::<K, Portable>(kernel, PhantomData)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{F32x8, F64x4, F64x8, U64x8};
    use super::*;

    /// All operations on the same numbers, as bits.
    struct All([[f64; 8]; 2], u32);

    impl SimdKernel for All {
        type Output = Vec<u64>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<u64> {
            let [a, b] = self.0.map(F64x8::<S>::new);
            let (less, shift) = (a.lt(b), self.1);
            // which NaN an operation makes is not part of the promise
            let number = |v: f64| if v.is_nan() { 1 } else { v.to_bits() };
            let sums = [a + b, a - b, a * b, a / b, a.sqrt()];
            let mut bits: Vec<u64> = sums.iter().flat_map(|v| v.to_array().map(number)).collect();
            let chosen = [
                a & b,
                a | b,
                a ^ b,
                -a,
                !a,
                a.abs(),
                a.max(b),
                a.min(b),
                less,
                a.le(b),
                a.gt(b),
                a.ge(b),
                a.equals(b),
                less.select(a, b),
            ];
            bits.extend(chosen.iter().flat_map(|v| v.to_bits().to_array()));
            let (p, q) = (a.to_bits(), b.to_bits());
            let integers = [p + q, p - q, p & q, p | q, p ^ q, p << shift, p >> shift];
            bits.extend(integers.iter().flat_map(|v| U64x8::to_array(*v)));
            bits.extend([less.to_bitmask().into(), u64::from(less.any())]);
            let four = |v: F64x8<S>| F64x4::<S>::new([0, 1, 2, 3].map(|i| v.as_array()[i]));
            let fours = [four(a) + four(b), four(a) - four(b), four(a) * four(b)];
            let numbers = fours.iter().flat_map(|v| v.to_array());
            bits.extend(numbers.map(number));
            let single = |v: F64x8<S>| F32x8::<S>::new(v.to_array().map(|v| v as f32));
            let singles = [single(a) + single(b), single(a) * single(b)];
            let numbers = singles.iter().flat_map(|v| v.to_array());
            bits.extend(numbers.map(|v| if v.is_nan() { 1 } else { v.to_bits().into() }));
            let row = |i: usize| [0, 1, 2, 3, 4, 5, 6, 7].map(|j| (8 * i + j) as f32 - 20.5);
            let rows = [0, 1, 2, 3, 4, 5, 6, 7].map(row);
            let columns = F64x8::<S>::columns(rows.each_ref());
            for (j, column) in columns.iter().enumerate() {
                let expected = rows.map(|row| f64::from(row[j]));
                assert_eq!(column.to_array(), expected, "column {j}");
            }
            bits
        }
    }

    #[test]
    fn all_levels_give_the_same_bits() {
        let special = [
            0.0,
            -0.0,
            1.0,
            -1.5,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MIN_POSITIVE / 4.0,
            1e300,
            -1e-300,
            f64::from_bits(u64::MAX),
        ];
        let at = |i: usize| special[i % special.len()] * (1.0 + (i / special.len()) as f64 * 0.37);
        for shift in 0..64 {
            let i = 5 * shift as usize;
            let a = std::array::from_fn(|lane| at(i + 3 * lane));
            let b = std::array::from_fn(|lane| at(7 * i + 2 * lane + 1));
            let expected = All([a, b], shift).run::<Portable>();
            for level in Level::supported() {
                let found = dispatch_at(level, All([a, b], shift));
                assert_eq!(found.as_ref(), Some(&expected), "{level}");
            }
        }
        assert_eq!(
            [Level::Portable, Level::V4].map(|level| dispatch_at(level, Empty).is_some()),
            [Level::Portable, Level::V4].map(Level::is_supported)
        );
    }

    struct Empty;

    impl SimdKernel for Empty {
        type Output = ();

        fn run<S: Simd>(self) {}
    }
}
