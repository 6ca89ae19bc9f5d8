//! Eight lanes: AVX2.
#![allow(unsafe_code, reason = "vector instructions, and reads of indices that the caller has checked")]

use super::{Block, Lanes, Task};
use glam::Vec3A;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Proof that the machine has AVX2: made by [`run`] alone.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

/// A register; made from an [`Avx2`], so it is a proof too.
#[derive(Clone, Copy)]
pub(crate) struct F32x8(__m256);

/// Runs a kernel; the caller has asked whether the machine has AVX2.
pub(super) fn run<T: Task>(task: T) -> T::Output {
    #[target_feature(enable = "avx2")]
    fn inner<T: Task>(task: T) -> T::Output {
        task.run(Avx2(()))
    }
    assert!(super::Isa::Avx2.is_available());
    // SAFETY: just asserted.
    unsafe { inner(task) }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $intrinsic:ident) => {
        impl $operator for F32x8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the operands are the proof of AVX2.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl Lanes for Avx2 {
    const WIDTH: usize = 8;
    type F = F32x8;

    #[inline(always)]
    fn splat(self, value: f32) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn load(self, from: &Block<f32>, part: usize) -> F32x8 {
        let part: &[f32; 8] = &from.0.as_chunks().0[part];
        // SAFETY: `self` is the proof of AVX2; half a block is 32 aligned bytes.
        F32x8(unsafe { _mm256_load_ps(part.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, value: F32x8, to: &mut Block<f32>, part: usize) {
        let part: &mut [f32; 8] = &mut to.0.as_chunks_mut().0[part];
        // SAFETY: `self` is the proof of AVX2; half a block is 32 aligned bytes.
        unsafe { _mm256_store_ps(part.as_mut_ptr(), value.0) }
    }

    #[inline(always)]
    fn min(self, a: F32x8, b: F32x8) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe { _mm256_min_ps(a.0, b.0) })
    }

    #[inline(always)]
    fn max(self, a: F32x8, b: F32x8) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe { _mm256_max_ps(a.0, b.0) })
    }

    #[inline(always)]
    fn abs(self, a: F32x8) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a.0) })
    }

    #[inline(always)]
    fn signed(self, magnitude: F32x8, sign: F32x8) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe {
            let some = _mm256_cmp_ps::<_CMP_NEQ_UQ>(sign.0, _mm256_setzero_ps());
            let bit = _mm256_and_ps(sign.0, _mm256_set1_ps(-0.0));
            _mm256_and_ps(some, _mm256_or_ps(magnitude.0, bit))
        })
    }

    #[inline(always)]
    fn less(self, a: F32x8, b: F32x8) -> u16 {
        // SAFETY: `self` is the proof of AVX2.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a.0, b.0)) as u16 }
    }

    #[inline(always)]
    fn select(self, mask: u16, yes: F32x8, no: F32x8) -> F32x8 {
        // SAFETY: `self` is the proof of AVX2.
        F32x8(unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(i32::from(mask)), bits), bits);
            _mm256_blendv_ps(no.0, yes.0, _mm256_castsi256_ps(set))
        })
    }

    #[inline(always)]
    unsafe fn rows(self, points: &[Vec3A], offsets: &Block<u32>, part: usize) -> [F32x8; 3] {
        const { assert!(size_of::<Vec3A>() == 16) };
        let base = points.as_ptr().cast::<f32>();
        let o: &[u32; 8] = &offsets.0.as_chunks().0[part];
        // SAFETY: `self` is the proof of AVX2; the caller vouches for the offsets, and a point is 16 aligned bytes.
        unsafe {
            let [a, b, c, d] = [
                every_fourth(base, o, 0),
                every_fourth(base, o, 1),
                every_fourth(base, o, 2),
                every_fourth(base, o, 3),
            ];
            let (ab, cd) = (_mm256_castps_pd(_mm256_unpacklo_ps(a, b)), _mm256_castps_pd(_mm256_unpacklo_ps(c, d)));
            let (abz, cdz) = (_mm256_castps_pd(_mm256_unpackhi_ps(a, b)), _mm256_castps_pd(_mm256_unpackhi_ps(c, d)));
            let x = _mm256_castpd_ps(_mm256_unpacklo_pd(ab, cd));
            let y = _mm256_castpd_ps(_mm256_unpackhi_pd(ab, cd));
            let z = _mm256_castpd_ps(_mm256_unpacklo_pd(abz, cdz));
            [F32x8(x), F32x8(y), F32x8(z)]
        }
    }
}

/// Rows i and i+4, so that the transposed lanes are in order. A function, not a closure: closures have not the caller's instructions.
///
/// # Safety
/// As for [`Lanes::rows`].
#[inline(always)]
unsafe fn every_fourth(base: *const f32, offsets: &[u32; 8], i: usize) -> __m256 {
    // SAFETY: handed on.
    unsafe {
        let low = _mm256_castps128_ps256(_mm_load_ps(base.byte_add(offsets[i] as usize)));
        _mm256_insertf128_ps::<1>(low, _mm_load_ps(base.byte_add(offsets[i + 4] as usize)))
    }
}
