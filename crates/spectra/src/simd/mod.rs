//! Vectors of 4 or 8 numbers, and kernels that are compiled for several instruction sets.
//!
//! The lane types ([`F64x8`] and others) carry an instruction set as type parameter. A
//! [`SimdKernel`] is generic over it; [`dispatch`] runs the kernel with the best instruction set
//! that the processor has, or the one that the environment variable `SPLITSNOW_SIMD` names.
//! No operation is fused and no sum is reordered, so all instruction sets give the same bits.
//!
//! Instructions of a level can be used only in functions that are compiled for it. These are
//! the function that [`dispatch`] enters and everything that the compiler inlines into it:
//! therefore a function that a kernel calls is `#[inline(always)]`, or it passes its body
//! to [`Simd::outlined`]. A function that is neither gives the same result, but slowly.
mod lanes;
mod level;
mod set;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use lanes::{F32x8, F64x4, F64x8, U64x8};
pub use level::{Level, LevelError, level, requested};
pub use set::{Portable, Simd, SimdKernel, Task, dispatch, dispatch_at};
