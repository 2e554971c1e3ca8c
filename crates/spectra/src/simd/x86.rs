//! The instruction sets of x86-64. The only module of the workspace with `unsafe`, for
//! three things that the compiler cannot check:
//!
//! - a function with `#[target_feature]` is called only where the processor has the
//!   features. [`V3`] and [`V4`] are private to `simd`; code is generic over them only
//!   below [`super::set::enter`], which takes levels for which [`has`] is true;
//! - intrinsics are called only from methods of [`V3`] and [`V4`], for the same reason;
//! - arrays and vectors of the same size have the same bits (`transmute`); all bits are
//!   valid for both.
#![allow(unsafe_code)]
use std::arch::x86_64::*;
use std::mem::transmute;

use super::set::sealed::Sealed;
use super::{Level, Portable, Simd, Task};

/// Whether the processor has the instructions of a level, and the system keeps its registers.
pub(super) fn has(level: Level) -> bool {
    let v3 = is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("movbe")
        && is_x86_feature_detected!("popcnt");
    match level {
        Level::V1 => true,
        Level::V3 => v3,
        Level::V4 => {
            v3 && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512cd")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
        }
        Level::Portable | Level::Neon => false,
    }
}

/// AVX2.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct V3;

/// AVX-512.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct V4;

impl Sealed for V3 {}
impl Sealed for V4 {}

#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,movbe,popcnt")]
fn in_v3<T: Task>(task: T) -> T::Output {
    task.perform()
}

#[inline(never)]
#[target_feature(
    enable = "avx2,bmi1,bmi2,lzcnt,movbe,popcnt,avx512f,avx512bw,avx512cd,avx512dq,avx512vl"
)]
fn in_v4<T: Task>(task: T) -> T::Output {
    task.perform()
}

/// Functions of two arrays by one intrinsic for each of the vectors of `$vector` that make
/// up the arrays.
macro_rules! by {
    ($([$scalar:ty; $lanes:literal] as $vector:ty: $($name:ident $intrinsic:ident $(<$immediate:ident>)?),*;)*) => {$($(
        #[inline(always)]
        fn $name(a: [$scalar; $lanes], b: [$scalar; $lanes]) -> [$scalar; $lanes] {
            const N: usize = size_of::<[$scalar; $lanes]>() / size_of::<$vector>();
            // SAFETY: see the module's text
            unsafe {
                let a: [$vector; N] = transmute(a);
                let b: [$vector; N] = transmute(b);
                let mut out = a;
                let mut i = 0;
                while i < N {
                    out[i] = $intrinsic $(::<$immediate>)? (a[i], b[i]);
                    i += 1;
                }
                transmute::<[$vector; N], [$scalar; $lanes]>(out)
            }
        }
    )*)*};
}

/// SSE2, which every x86-64 processor has.
impl Simd for Portable {
    const LEVEL: Level = Level::V1;

    #[inline(never)]
    fn outlined<T: Task>(task: T) -> T::Output {
        task.perform()
    }

    by! {
        [f64; 8] as __m128d:
            add _mm_add_pd, sub _mm_sub_pd, mul _mm_mul_pd, div _mm_div_pd,
            and _mm_and_pd, or _mm_or_pd, xor _mm_xor_pd,
            max _mm_max_pd, min _mm_min_pd,
            lt _mm_cmplt_pd, le _mm_cmple_pd, equals _mm_cmpeq_pd;
        [f64; 4] as __m128d:
            add_4 _mm_add_pd, sub_4 _mm_sub_pd, mul_4 _mm_mul_pd;
        [f32; 8] as __m128:
            add_single _mm_add_ps, mul_single _mm_mul_ps;
        [u64; 8] as __m128i:
            add_integers _mm_add_epi64, sub_integers _mm_sub_epi64,
            and_integers _mm_and_si128, or_integers _mm_or_si128,
            xor_integers _mm_xor_si128;
    }

    #[inline(always)]
    fn sqrt(a: [f64; 8]) -> [f64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let [a, b, c, d]: [__m128d; 4] = transmute(a);
            transmute([
                _mm_sqrt_pd(a),
                _mm_sqrt_pd(b),
                _mm_sqrt_pd(c),
                _mm_sqrt_pd(d),
            ])
        }
    }

    #[inline(always)]
    fn select(mask: [f64; 8], yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        // all bits of a mask are the same: no ^ (mask & (yes ^ no))
        Self::xor(no, Self::and(mask, Self::xor(yes, no)))
    }

    #[inline(always)]
    fn bitmask(mask: [f64; 8]) -> u32 {
        // SAFETY: see the module's text
        unsafe {
            let [a, b, c, d]: [__m128d; 4] = transmute(mask);
            (_mm_movemask_pd(a)
                | _mm_movemask_pd(b) << 2
                | _mm_movemask_pd(c) << 4
                | _mm_movemask_pd(d) << 6) as u32
        }
    }
}

/// The columns of eight rows, for methods of [`V3`] and [`V4`].
///
/// # Safety
/// The processor has AVX.
#[inline(always)]
unsafe fn transposed(rows: [&[f32; 8]; 8]) -> [__m256; 8] {
    // SAFETY: the reads are within the rows
    unsafe {
        let r = rows.map(|row| _mm256_loadu_ps(row.as_ptr()));
        let pairs = [
            _mm256_unpacklo_ps(r[0], r[1]),
            _mm256_unpackhi_ps(r[0], r[1]),
            _mm256_unpacklo_ps(r[2], r[3]),
            _mm256_unpackhi_ps(r[2], r[3]),
            _mm256_unpacklo_ps(r[4], r[5]),
            _mm256_unpackhi_ps(r[4], r[5]),
            _mm256_unpacklo_ps(r[6], r[7]),
            _mm256_unpackhi_ps(r[6], r[7]),
        ];
        let fours = [
            _mm256_shuffle_ps::<0x44>(pairs[0], pairs[2]),
            _mm256_shuffle_ps::<0xee>(pairs[0], pairs[2]),
            _mm256_shuffle_ps::<0x44>(pairs[1], pairs[3]),
            _mm256_shuffle_ps::<0xee>(pairs[1], pairs[3]),
            _mm256_shuffle_ps::<0x44>(pairs[4], pairs[6]),
            _mm256_shuffle_ps::<0xee>(pairs[4], pairs[6]),
            _mm256_shuffle_ps::<0x44>(pairs[5], pairs[7]),
            _mm256_shuffle_ps::<0xee>(pairs[5], pairs[7]),
        ];
        [
            _mm256_permute2f128_ps::<0x20>(fours[0], fours[4]),
            _mm256_permute2f128_ps::<0x20>(fours[1], fours[5]),
            _mm256_permute2f128_ps::<0x20>(fours[2], fours[6]),
            _mm256_permute2f128_ps::<0x20>(fours[3], fours[7]),
            _mm256_permute2f128_ps::<0x31>(fours[0], fours[4]),
            _mm256_permute2f128_ps::<0x31>(fours[1], fours[5]),
            _mm256_permute2f128_ps::<0x31>(fours[2], fours[6]),
            _mm256_permute2f128_ps::<0x31>(fours[3], fours[7]),
        ]
    }
}

impl Simd for V3 {
    const LEVEL: Level = Level::V3;

    #[inline(always)]
    fn outlined<T: Task>(task: T) -> T::Output {
        // SAFETY: see the module's text
        unsafe { in_v3(task) }
    }

    by! {
        [f64; 8] as __m256d:
            add _mm256_add_pd, sub _mm256_sub_pd, mul _mm256_mul_pd, div _mm256_div_pd,
            and _mm256_and_pd, or _mm256_or_pd, xor _mm256_xor_pd,
            max _mm256_max_pd, min _mm256_min_pd,
            lt _mm256_cmp_pd<_CMP_LT_OQ>, le _mm256_cmp_pd<_CMP_LE_OQ>,
            equals _mm256_cmp_pd<_CMP_EQ_OQ>;
        [f64; 4] as __m256d:
            add_4 _mm256_add_pd, sub_4 _mm256_sub_pd, mul_4 _mm256_mul_pd;
        [f32; 8] as __m256:
            add_single _mm256_add_ps, mul_single _mm256_mul_ps;
        [u64; 8] as __m256i:
            add_integers _mm256_add_epi64, sub_integers _mm256_sub_epi64,
            and_integers _mm256_and_si256, or_integers _mm256_or_si256,
            xor_integers _mm256_xor_si256;
    }

    #[inline(always)]
    fn columns(rows: [&[f32; 8]; 8]) -> [[f64; 8]; 8] {
        // SAFETY: see the module's text
        unsafe {
            let columns = transposed(rows);
            let mut out = [[0.0; 8]; 8];
            let mut i = 0;
            while i < 8 {
                let low = _mm256_cvtps_pd(_mm256_castps256_ps128(columns[i]));
                let high = _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(columns[i]));
                out[i] = transmute::<[__m256d; 2], [f64; 8]>([low, high]);
                i += 1;
            }
            out
        }
    }

    #[inline(always)]
    fn sqrt(a: [f64; 8]) -> [f64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let [a, b]: [__m256d; 2] = transmute(a);
            transmute([_mm256_sqrt_pd(a), _mm256_sqrt_pd(b)])
        }
    }

    #[inline(always)]
    fn select(mask: [f64; 8], yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let mask: [__m256d; 2] = transmute(mask);
            let yes: [__m256d; 2] = transmute(yes);
            let no: [__m256d; 2] = transmute(no);
            transmute([
                _mm256_blendv_pd(no[0], yes[0], mask[0]),
                _mm256_blendv_pd(no[1], yes[1], mask[1]),
            ])
        }
    }

    #[inline(always)]
    fn bitmask(mask: [f64; 8]) -> u32 {
        // SAFETY: see the module's text
        unsafe {
            let [low, high]: [__m256d; 2] = transmute(mask);
            (_mm256_movemask_pd(low) | _mm256_movemask_pd(high) << 4) as u32
        }
    }

    #[inline(always)]
    fn shl(a: [u64; 8], bits: u32) -> [u64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let [a, b]: [__m256i; 2] = transmute(a);
            let count = _mm_cvtsi32_si128(bits as i32);
            transmute([_mm256_sll_epi64(a, count), _mm256_sll_epi64(b, count)])
        }
    }

    #[inline(always)]
    fn shr(a: [u64; 8], bits: u32) -> [u64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let [a, b]: [__m256i; 2] = transmute(a);
            let count = _mm_cvtsi32_si128(bits as i32);
            transmute([_mm256_srl_epi64(a, count), _mm256_srl_epi64(b, count)])
        }
    }
}

/// A comparison with AVX-512, whose masks have one bit for each lane.
macro_rules! compared {
    ($($name:ident $predicate:ident),*) => {$(
        #[inline(always)]
        fn $name(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
            // SAFETY: see the module's text
            unsafe {
                let [a, b]: [__m512d; 2] = transmute([a, b]);
                transmute(_mm512_movm_epi64(_mm512_cmp_pd_mask::<$predicate>(a, b)))
            }
        }
    )*};
}

impl Simd for V4 {
    const LEVEL: Level = Level::V4;

    #[inline(always)]
    fn outlined<T: Task>(task: T) -> T::Output {
        // SAFETY: see the module's text
        unsafe { in_v4(task) }
    }

    by! {
        [f64; 8] as __m512d:
            add _mm512_add_pd, sub _mm512_sub_pd, mul _mm512_mul_pd, div _mm512_div_pd,
            and _mm512_and_pd, or _mm512_or_pd, xor _mm512_xor_pd,
            max _mm512_max_pd, min _mm512_min_pd;
        [f64; 4] as __m256d:
            add_4 _mm256_add_pd, sub_4 _mm256_sub_pd, mul_4 _mm256_mul_pd;
        [f32; 8] as __m256:
            add_single _mm256_add_ps, mul_single _mm256_mul_ps;
        [u64; 8] as __m512i:
            add_integers _mm512_add_epi64, sub_integers _mm512_sub_epi64,
            and_integers _mm512_and_si512, or_integers _mm512_or_si512,
            xor_integers _mm512_xor_si512;
    }

    compared!(lt _CMP_LT_OQ, le _CMP_LE_OQ, equals _CMP_EQ_OQ);

    #[inline(always)]
    fn columns(rows: [&[f32; 8]; 8]) -> [[f64; 8]; 8] {
        // SAFETY: see the module's text
        unsafe {
            let columns = transposed(rows);
            let mut out = [[0.0; 8]; 8];
            let mut i = 0;
            while i < 8 {
                out[i] = transmute::<__m512d, [f64; 8]>(_mm512_cvtps_pd(columns[i]));
                i += 1;
            }
            out
        }
    }

    #[inline(always)]
    fn sqrt(a: [f64; 8]) -> [f64; 8] {
        // SAFETY: see the module's text
        unsafe { transmute(_mm512_sqrt_pd(transmute::<[f64; 8], __m512d>(a))) }
    }

    #[inline(always)]
    fn select(mask: [f64; 8], yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let mask = _mm512_movepi64_mask(transmute::<[f64; 8], __m512i>(mask));
            let [yes, no]: [__m512d; 2] = transmute([yes, no]);
            transmute(_mm512_mask_blend_pd(mask, no, yes))
        }
    }

    #[inline(always)]
    fn bitmask(mask: [f64; 8]) -> u32 {
        // SAFETY: see the module's text
        unsafe { u32::from(_mm512_movepi64_mask(transmute::<[f64; 8], __m512i>(mask))) }
    }

    #[inline(always)]
    fn shl(a: [u64; 8], bits: u32) -> [u64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let count = _mm_cvtsi32_si128(bits as i32);
            transmute(_mm512_sll_epi64(transmute::<[u64; 8], __m512i>(a), count))
        }
    }

    #[inline(always)]
    fn shr(a: [u64; 8], bits: u32) -> [u64; 8] {
        // SAFETY: see the module's text
        unsafe {
            let count = _mm_cvtsi32_si128(bits as i32);
            transmute(_mm512_srl_epi64(transmute::<[u64; 8], __m512i>(a), count))
        }
    }
}
