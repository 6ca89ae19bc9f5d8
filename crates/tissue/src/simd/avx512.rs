//! Sixteen lanes: AVX-512.
#![allow(unsafe_code, reason = "vector instructions, and reads of indices that the caller has checked")]

use super::{Block, Lanes, Task};
use glam::Vec3A;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Proof that the machine has AVX-512: made by [`run`] alone.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

/// A register; made from an [`Avx512`], so it is a proof too.
#[derive(Clone, Copy)]
pub(crate) struct F32x16(__m512);

/// Runs a kernel; the caller has asked whether the machine has AVX-512.
pub(super) fn run<T: Task>(task: T) -> T::Output {
    #[target_feature(enable = "avx512f,avx512dq")]
    fn inner<T: Task>(task: T) -> T::Output {
        task.run(Avx512(()))
    }
    assert!(super::Isa::Avx512.is_available());
    // SAFETY: just asserted.
    unsafe { inner(task) }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $intrinsic:ident) => {
        impl $operator for F32x16 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the operands are the proof of AVX-512.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, _mm512_add_ps);
operator!(Sub, sub, _mm512_sub_ps);
operator!(Mul, mul, _mm512_mul_ps);
operator!(Div, div, _mm512_div_ps);

impl Lanes for Avx512 {
    const WIDTH: usize = 16;
    type F = F32x16;

    #[inline(always)]
    fn splat(self, value: f32) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn load(self, from: &Block<f32>, _: usize) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512; a block is 64 aligned bytes.
        F32x16(unsafe { _mm512_load_ps(from.0.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, value: F32x16, to: &mut Block<f32>, _: usize) {
        // SAFETY: `self` is the proof of AVX-512; a block is 64 aligned bytes.
        unsafe { _mm512_store_ps(to.0.as_mut_ptr(), value.0) }
    }

    #[inline(always)]
    fn min(self, a: F32x16, b: F32x16) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe { _mm512_min_ps(a.0, b.0) })
    }

    #[inline(always)]
    fn max(self, a: F32x16, b: F32x16) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe { _mm512_max_ps(a.0, b.0) })
    }

    #[inline(always)]
    fn abs(self, a: F32x16) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe { _mm512_abs_ps(a.0) })
    }

    #[inline(always)]
    fn signed(self, magnitude: F32x16, sign: F32x16) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe {
            let some = _mm512_cmp_ps_mask::<_CMP_NEQ_UQ>(sign.0, _mm512_setzero_ps());
            let bit = _mm512_and_ps(sign.0, _mm512_set1_ps(-0.0));
            _mm512_maskz_or_ps(some, magnitude.0, bit)
        })
    }

    #[inline(always)]
    fn less(self, a: F32x16, b: F32x16) -> u16 {
        // SAFETY: `self` is the proof of AVX-512.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a.0, b.0) }
    }

    #[inline(always)]
    fn select(self, mask: u16, yes: F32x16, no: F32x16) -> F32x16 {
        // SAFETY: `self` is the proof of AVX-512.
        F32x16(unsafe { _mm512_mask_blend_ps(mask, no.0, yes.0) })
    }

    #[inline(always)]
    unsafe fn rows(self, points: &[Vec3A], Block(o): &Block<u32>, _: usize) -> [F32x16; 3] {
        const { assert!(size_of::<Vec3A>() == 16) };
        let base = points.as_ptr().cast::<f32>();
        // SAFETY: `self` is the proof of AVX-512; the caller vouches for the offsets, and a point is 16 aligned bytes.
        unsafe {
            let [a, b, c, d] = [
                every_fourth(base, o, 0),
                every_fourth(base, o, 1),
                every_fourth(base, o, 2),
                every_fourth(base, o, 3),
            ];
            let (ab, cd) = (_mm512_castps_pd(_mm512_unpacklo_ps(a, b)), _mm512_castps_pd(_mm512_unpacklo_ps(c, d)));
            let (abz, cdz) = (_mm512_castps_pd(_mm512_unpackhi_ps(a, b)), _mm512_castps_pd(_mm512_unpackhi_ps(c, d)));
            let x = _mm512_castpd_ps(_mm512_unpacklo_pd(ab, cd));
            let y = _mm512_castpd_ps(_mm512_unpackhi_pd(ab, cd));
            let z = _mm512_castpd_ps(_mm512_unpacklo_pd(abz, cdz));
            [F32x16(x), F32x16(y), F32x16(z)]
        }
    }
}

/// Rows i, i+4, i+8, i+12, so that the transposed lanes are in order. A function, not a closure: closures have not the caller's instructions.
///
/// # Safety
/// As for [`Lanes::rows`].
#[inline(always)]
unsafe fn every_fourth(base: *const f32, offsets: &[u32; 16], i: usize) -> __m512 {
    // SAFETY: handed on.
    unsafe {
        let rows = _mm512_castps128_ps512(_mm_load_ps(base.byte_add(offsets[i] as usize)));
        let rows = _mm512_insertf32x4::<1>(rows, _mm_load_ps(base.byte_add(offsets[i + 4] as usize)));
        let rows = _mm512_insertf32x4::<2>(rows, _mm_load_ps(base.byte_add(offsets[i + 8] as usize)));
        _mm512_insertf32x4::<3>(rows, _mm_load_ps(base.byte_add(offsets[i + 12] as usize)))
    }
}
