//! Four lanes of plain code, which compilers turn into the baseline's vector instructions.
#![allow(unsafe_code, reason = "reads of indices that the caller has checked")]

use super::{BLOCK, Block, Lanes};
use glam::Vec3A;
use std::ops::{Add, Div, Mul, Sub};

const WIDTH: usize = 4;

/// Plain code: every machine has it.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

/// A register.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(crate) struct F32x4([f32; WIDTH]);

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl $operator for F32x4 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(other, |a, b| a.$method(b))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl F32x4 {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let (a, b) = (self.0, other.0);
        Self([f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])])
    }
}

impl Lanes for Portable {
    const WIDTH: usize = WIDTH;
    type F = F32x4;

    #[inline(always)]
    fn splat(self, value: f32) -> F32x4 {
        F32x4([value; WIDTH])
    }

    #[inline(always)]
    fn load(self, from: &Block<f32>, part: usize) -> F32x4 {
        F32x4(from.0.as_chunks().0[part])
    }

    #[inline(always)]
    fn store(self, value: F32x4, to: &mut Block<f32>, part: usize) {
        to.0.as_chunks_mut().0[part] = value.0;
    }

    #[inline(always)]
    fn min(self, a: F32x4, b: F32x4) -> F32x4 {
        a.with(b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: F32x4, b: F32x4) -> F32x4 {
        a.with(b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self, a: F32x4) -> F32x4 {
        F32x4(a.0.map(f32::abs))
    }

    #[inline(always)]
    fn signed(self, magnitude: F32x4, sign: F32x4) -> F32x4 {
        magnitude.with(sign, |m, s| if s == 0.0 { 0.0 } else { m.copysign(s) })
    }

    #[inline(always)]
    fn less(self, a: F32x4, b: F32x4) -> u16 {
        let bit = |i: usize| u16::from(a.0[i] < b.0[i]) << i;
        bit(0) | bit(1) | bit(2) | bit(3)
    }

    #[inline(always)]
    fn select(self, mask: u16, yes: F32x4, no: F32x4) -> F32x4 {
        let lane = |i: usize| if mask >> i & 1 == 1 { yes.0[i] } else { no.0[i] };
        F32x4([lane(0), lane(1), lane(2), lane(3)])
    }

    #[inline(always)]
    unsafe fn rows(self, points: &[Vec3A], offsets: &Block<u32>, part: usize) -> [F32x4; 3] {
        const { assert!(size_of::<Vec3A>() == 16 && BLOCK.is_multiple_of(WIDTH)) };
        let offsets: [u32; WIDTH] = offsets.0.as_chunks().0[part];
        // SAFETY: the caller vouches for the indices.
        unsafe {
            let a = points.get_unchecked(offsets[0] as usize / 16);
            let b = points.get_unchecked(offsets[1] as usize / 16);
            let c = points.get_unchecked(offsets[2] as usize / 16);
            let d = points.get_unchecked(offsets[3] as usize / 16);
            [F32x4([a.x, b.x, c.x, d.x]), F32x4([a.y, b.y, c.y, d.y]), F32x4([a.z, b.z, c.z, d.z])]
        }
    }
}
