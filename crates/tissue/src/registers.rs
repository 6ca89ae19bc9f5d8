//! Numbers of the sweeps: blocks of sixteen, which the machine's widest registers hold whole and
//! narrower ones in parts.
//!
//! A sweep keeps some twenty vectors at once: sixteen lanes of each would not fit into the
//! registers of AVX2. So its kernels are written over [`Simd::f32s`]. Lanes never meet and nothing
//! is fused: all instruction sets give the same bits. Functions that kernels call in their inner
//! loops must be `#[inline(always)]`, and neither closures nor iterators' adaptors that take one:
//! only functions that are certainly inlined are compiled with the registers' instructions.

#[cfg(target_arch = "x86_64")]
use fearless_simd::SimdInto;
use fearless_simd::{Select, Simd, SimdBase, SimdCombine, SimdFloat, SimdMask, f32x4};
use glam::Vec3A;

/// Lanes of a [`Block`].
pub(crate) const BLOCK: usize = 16;

/// The numbers of the widest register.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Block<T>(pub [T; BLOCK]);

/// A register, and three.
pub(crate) type Reg<S> = <S as Simd>::f32s;
pub(crate) type Reg3<S> = [Reg<S>; 3];
/// A condition for each lane of a register.
pub(crate) type Mask<S> = <S as Simd>::mask32s;

/// Lanes of a register.
#[inline(always)]
pub(crate) const fn width<S: Simd>() -> usize {
    <Reg<S> as SimdBase<S>>::LEN
}

/// Parts of a block.
#[inline(always)]
pub(crate) const fn parts<S: Simd>() -> usize {
    BLOCK / width::<S>()
}

#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, x: f32) -> Reg<S> {
    Reg::<S>::splat(simd, x)
}

/// A part of a block.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, from: &Block<f32>, part: usize) -> Reg<S> {
    Reg::<S>::from_slice(simd, &from.0[part * width::<S>()..(part + 1) * width::<S>()])
}

#[inline(always)]
pub(crate) fn store<S: Simd>(value: Reg<S>, to: &mut Block<f32>, part: usize) {
    value.store_slice(&mut to.0[part * width::<S>()..(part + 1) * width::<S>()]);
}

#[inline(always)]
pub(crate) fn load3<S: Simd>(simd: S, from: &[Block<f32>; 3], part: usize) -> Reg3<S> {
    [load(simd, &from[0], part), load(simd, &from[1], part), load(simd, &from[2], part)]
}

#[inline(always)]
pub(crate) fn store3<S: Simd>(value: Reg3<S>, to: &mut [Block<f32>; 3], part: usize) {
    store::<S>(value[0], &mut to[0], part);
    store::<S>(value[1], &mut to[1], part);
    store::<S>(value[2], &mut to[2], part);
}

/// `magnitude`, not negative, with the sign of `sign`; 0 where `sign` is 0.
#[inline(always)]
pub(crate) fn signed<S: Simd>(simd: S, magnitude: Reg<S>, sign: Reg<S>) -> Reg<S> {
    let zero = splat(simd, 0.0);
    sign.simd_eq(zero).select(zero, magnitude.copysign(sign))
}

/// `mask`'s bits of a part.
#[inline(always)]
pub(crate) fn part_of<S: Simd>(mask: u16, part: usize) -> u16 {
    (u32::from(mask) >> (part * width::<S>())) as u16 & ((1u32 << width::<S>()) - 1) as u16
}

/// The lanes whose bits are set.
#[inline(always)]
pub(crate) fn lanes<S: Simd>(simd: S, bits: u16) -> Mask<S> {
    Mask::<S>::from_bitmask(simd, u64::from(bits))
}

/// The bits of a mask's lanes.
#[inline(always)]
pub(crate) fn bits<S: Simd>(mask: Mask<S>) -> u16 {
    mask.to_bitmask() as u16
}

/// The points that a part of `at` names, transposed from rows into registers; zeros if there are
/// none.
#[inline(always)]
pub(crate) fn rows<S: Simd>(simd: S, points: &[Vec3A], at: &Block<u32>, part: usize) -> Reg3<S> {
    if points.is_empty() {
        return [splat(simd, 0.0); 3];
    }
    let (quarter, first) = (width::<S>() / 4, part * width::<S>());
    let a = some(simd, points, at, first);
    let b = some(simd, points, at, first + quarter);
    let c = some(simd, points, at, first + 2 * quarter);
    let d = some(simd, points, at, first + 3 * quarter);
    let (xz0, xz1) = (a.unzip_low(b), c.unzip_low(d));
    let (yw0, yw1) = (a.unzip_high(b), c.unzip_high(d));
    [xz0.unzip_low(xz1), yw0.unzip_low(yw1), xz0.unzip_high(xz1)]
}

/// The rows that fill a register, one after the other.
#[inline(always)]
fn some<S: Simd>(simd: S, points: &[Vec3A], at: &Block<u32>, k: usize) -> Reg<S> {
    match width::<S>() {
        4 => Reg::<S>::from_slice(simd, row(simd, points, at.0[k]).as_slice()),
        8 => {
            let rows = row(simd, points, at.0[k]).combine(row(simd, points, at.0[k + 1]));
            Reg::<S>::from_slice(simd, rows.as_slice())
        }
        _ => {
            let low = row(simd, points, at.0[k]).combine(row(simd, points, at.0[k + 1]));
            let high = row(simd, points, at.0[k + 2]).combine(row(simd, points, at.0[k + 3]));
            Reg::<S>::from_slice(simd, low.combine(high).as_slice())
        }
    }
}

/// A point and the number beside it.
#[inline(always)]
fn row<S: Simd>(simd: S, points: &[Vec3A], at: u32) -> f32x4<S> {
    // All places are in range. The clamp says so at less cost than a check with an error for each
    // row, which made a sweep a seventh slower.
    as_row(simd, points[(at as usize).min(points.len() - 1)])
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn as_row<S: Simd>(simd: S, point: Vec3A) -> f32x4<S> {
    std::arch::x86_64::__m128::from(point).simd_into(simd)
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn as_row<S: Simd>(simd: S, point: Vec3A) -> f32x4<S> {
    f32x4::from_slice(simd, &point.extend(0.0).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Isa;
    use fearless_simd::dispatch;

    /// One of everything, for each part of a block.
    #[inline(always)]
    fn everything<S: Simd>(simd: S, points: &[Vec3A]) -> Vec<u32> {
        let block = |k: f32| Block(std::array::from_fn(|i| ((i as f32 + 1.0) * k).sin()));
        let (a, b, mut out) = (block(0.7), block(1.9), [Block([0.0f32; BLOCK]); 11]);
        let mut sign = b;
        sign.0[3] = 0.0;
        let at = Block(std::array::from_fn(|i| (i as u32 * 7) % 19));
        let mut masks = 0u32;
        for part in 0..parts::<S>() {
            let (x, y) = (load(simd, &a, part), load(simd, &b, part));
            let rows = rows(simd, points, &at, part);
            let less = x.simd_lt(y);
            masks |= u32::from(bits::<S>(less)) << (part * width::<S>());
            let all = [
                x + y * x - x / y,
                x.min(y),
                x.max(y),
                x.abs(),
                signed(simd, splat(simd, 2.5), load(simd, &sign, part)),
                lanes(simd, part_of::<S>(0b0110_1001_1010_0011, part)).select(x, y),
                less.select(x, y),
                rows[0],
                rows[1],
                rows[2],
                x * y + x,
            ];
            for (value, out) in all.into_iter().zip(&mut out) {
                store::<S>(value, out, part);
            }
        }
        let bits = out.iter().flat_map(|b| b.0).map(f32::to_bits);
        bits.chain([masks]).collect()
    }

    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        let points: Vec<Vec3A> = (0..19).map(|i| Vec3A::new(i as f32, i as f32 + 0.25, -(i as f32))).collect();
        let run = |isa: Isa| dispatch!(isa.level(), simd => everything(simd, &points));
        let expected = run(Isa::Portable);
        assert_eq!(expected[4 * BLOCK + 3], 0);
        assert_eq!(f32::from_bits(expected[8 * BLOCK + 2]), 14.25);
        for isa in Isa::ALL {
            assert_eq!(run(isa), expected, "{}", isa.name());
        }
    }
}
