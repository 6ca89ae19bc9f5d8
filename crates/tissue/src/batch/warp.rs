//! The rotation of the tissue about each node in each lane, which turns a gradient into the frame
//! in which the stiffness at rest holds (stiffness warping, Mueller and others, "Stable real-time
//! deformations", 2002).
//!
//! Tissue whose areas grow becomes stiffer against changes of volume. Steps of the stiffness at
//! rest are too long there: they are rejected, or what is too much in one substep grows in the
//! next. So both sides are divided by the root of this stiffening too.
//!
//! All this only speeds the search up: any invertible matrices in place of the rotations keep the
//! preconditioner symmetric and positive definite. So a few rounds of the polar decomposition are
//! enough.

use super::elastic::{areas, modes};
use super::topology::Topology;
use crate::registers::{Block, Reg, load, splat, store};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat};

/// Rounds of the polar decomposition.
const ROUNDS: usize = 3;

/// Volume ratio below which a neighbourhood is not turned.
pub(super) const MIN_RATIO: f32 = 0.05;

/// Greatest stiffening of a node.
const MAX_STIFFENING: f32 = 20.0;

/// A rotation by node, by columns, over the root of the node's stiffening.
pub(super) type Rotations = Vec<[Block<f32>; 9]>;

/// Stiffening by node: how many times the stiffness at rest the tissue about it has.
pub(super) type Stiffening = Vec<Block<f32>>;

/// Computes the rotations at the displacements `u` (in cells).
#[inline(always)]
pub(super) fn update<S: Simd>(
    simd: S,
    topology: &Topology,
    u: &[[Block<f32>; 3]],
    rotations: &mut [[Block<f32>; 9]],
    stiffening: &mut [Block<f32>],
    part: usize,
) {
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    for (rotation, stiffening) in rotations.iter_mut().zip(stiffening.iter_mut()) {
        for e in 0..9 {
            store::<S>(zero, &mut rotation[e], part);
        }
        store::<S>(one, stiffening, part);
    }
    for cell in &topology.cells {
        let mut f = [zero; 9];
        for k in 0..3 {
            let m = modes(simd, u, &cell.nodes, k, part);
            for c in 0..3 {
                f[3 * c + k] = if c == k { m[c] + 1.0 } else { m[c] };
            }
            for node in &cell.nodes {
                let rotation = &mut rotations[*node as usize];
                for c in 0..3 {
                    let to = &mut rotation[3 * c + k];
                    store::<S>(load(simd, to, part) + m[c] * cell.volume, to, part);
                }
            }
        }
        let stiffer = stiffer(simd, &f);
        for node in &cell.nodes {
            let to = &mut stiffening[*node as usize];
            store::<S>(stiffer.max(load(simd, to, part)), to, part);
        }
    }
    for ((rotation, weight), stiffening) in rotations.iter_mut().zip(&topology.turning).zip(stiffening) {
        let mut f = [zero; 9];
        for e in 0..9 {
            f[e] = load(simd, &rotation[e], part) * *weight;
        }
        for c in 0..3 {
            f[4 * c] += 1.0;
        }
        let r = polar(simd, f);
        let scale = one / load(simd, stiffening, part).sqrt();
        for e in 0..9 {
            store::<S>(r[e] * scale, &mut rotation[e], part);
        }
    }
}

/// The largest square of an area over the area at rest, nearly: the sum of the three less 2, which
/// is right where the other two are as at rest. The stiffness against changes of volume grows by
/// it. 1 where F is not finite.
#[inline(always)]
fn stiffer<S: Simd>(simd: S, f: &[Reg<S>; 9]) -> Reg<S> {
    let one = splat(simd, 1.0);
    let (cofactor, _) = areas(f);
    let mut sum = splat(simd, -2.0);
    for e in 0..9 {
        sum += cofactor[e] * cofactor[e];
    }
    // NaN compares false.
    sum.simd_gt(one).select(sum.min(splat(simd, MAX_STIFFENING)), one)
}

/// The rotation of F, nearly: Newton's iteration (Higham, "Computing the polar decomposition",
/// 1986), the first round scaled. The identity where F is flat.
#[inline(always)]
fn polar<S: Simd>(simd: S, f: [Reg<S>; 9]) -> [Reg<S>; 9] {
    let (zero, one, half) = (splat(simd, 0.0), splat(simd, 1.0), splat(simd, 0.5));
    let (_, ratio) = areas(&f);
    // NaN compares false.
    let sound = ratio.simd_gt(splat(simd, MIN_RATIO));
    let mut x = f;
    for e in 0..9 {
        x[e] = sound.select(x[e], if e % 4 == 0 { one } else { zero });
    }
    for round in 0..ROUNDS {
        let (cofactor, ratio) = areas(&x);
        let inverse = one / ratio;
        let (mut near, mut far) = (half, half * inverse);
        if round == 0 {
            let (mut size, mut other) = (zero, zero);
            for e in 0..9 {
                size += x[e] * x[e];
                other += cofactor[e] * cofactor[e];
            }
            let scale = (other * inverse * inverse / size).sqrt().sqrt();
            near *= scale;
            far /= scale;
        }
        for e in 0..9 {
            x[e] = x[e] * near + cofactor[e] * far;
        }
    }
    x
}

/// Turns a field into the frame at rest, in place.
#[inline(always)]
pub(super) fn to_rest<S: Simd>(simd: S, rotations: &[[Block<f32>; 9]], v: &mut [[Block<f32>; 3]], part: usize) {
    for (rotation, v) in rotations.iter().zip(v) {
        let (x, y, z) = (load(simd, &v[0], part), load(simd, &v[1], part), load(simd, &v[2], part));
        for c in 0..3 {
            let (a, b, d) = (
                load(simd, &rotation[3 * c], part),
                load(simd, &rotation[3 * c + 1], part),
                load(simd, &rotation[3 * c + 2], part),
            );
            store::<S>(a * x + b * y + d * z, &mut v[c], part);
        }
    }
}

/// Turns a field out of the frame at rest, in place. Returns the sum of its products with another
/// field, if there is one.
#[inline(always)]
pub(super) fn out_of_rest<S: Simd>(
    simd: S,
    rotations: &[[Block<f32>; 9]],
    v: &mut [[Block<f32>; 3]],
    other: &[[Block<f32>; 3]],
    part: usize,
) -> Reg<S> {
    let mut sums = [splat(simd, 0.0); 3];
    for (i, (rotation, v)) in rotations.iter().zip(v).enumerate() {
        let (x, y, z) = (load(simd, &v[0], part), load(simd, &v[1], part), load(simd, &v[2], part));
        for k in 0..3 {
            let (a, b, d) = (
                load(simd, &rotation[k], part),
                load(simd, &rotation[3 + k], part),
                load(simd, &rotation[6 + k], part),
            );
            let turned = a * x + b * y + d * z;
            store::<S>(turned, &mut v[k], part);
            if let Some(other) = other.get(i) {
                sums[k] += turned * load(simd, &other[k], part);
            }
        }
    }
    sums[0] + sums[1] + sums[2]
}
