//! Elastic forces of all cells, an instance in each lane.
//!
//! The law is stable neo-Hookean with the limits of `trocar-lattice`. In a cell the displacement is
//! a sum of eight modes 1, x, y, z, xy, xz, yz, xyz of the corners. F at a point is a sum of seven
//! of them with weights that all lanes share.
//!
//! The fictitious tissue of boundary cells is simpler than in `trocar-lattice`: its |F|^2 is
//! integrated exactly, and its volume ratio is that of the middle. It has no limits.

use super::topology::{Place, Topology};
use crate::registers::{Block, Reg, load, splat, store, width};
use fearless_simd::{Select, Simd, SimdBase, SimdMask};
use glam::DMat3;
use trocar_lattice::Material;

/// Volume ratio below which the barrier of the limits may act.
pub(super) const LIMITED_RATIO: f32 = 0.2;

/// |F|^2 above which the limit of stretch may act.
pub(super) const LIMITED_SQUARE: f32 = 16.0;

/// Nine numbers of a matrix, column by column.
type Nine<S> = [Reg<S>; 9];

/// Adds the gradient of the elastic energy over Young's modulus at the displacements `u` (in
/// cells). Returns the least volume ratio in each lane.
#[inline(always)]
pub(super) fn add_elastic<S: Simd>(
    simd: S,
    topology: &Topology,
    u: &[[Block<f32>; 3]],
    gradient: &mut [[Block<f32>; 3]],
    part: usize,
) -> Reg<S> {
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    let mut least = one;
    let mut f = [[zero; 9]; 9];
    let mut p = [[zero; 9]; 9];
    for cell in &topology.cells {
        let mut m = [[zero; 7]; 3];
        let mut others = zero;
        for k in 0..3 {
            m[k] = modes(simd, u, &cell.nodes, k, part);
            let unit = [[one, zero, zero], [zero, one, zero], [zero, zero, one]][k];
            for (at, f) in cell.points.iter().zip(&mut f) {
                deform::<S>(&m[k], at, unit, k, f);
            }
            others += m[k][3] * m[k][3] + m[k][4] * m[k][4] + m[k][5] * m[k][5] + m[k][6] * m[k][6];
        }
        let weight = cell.volume / 8.0;
        let mut low = one;
        for point in 0..8 {
            let (cofactor, ratio) = areas(&f[point]);
            low = low.min(ratio);
            let by = (ratio - 1.0) * (topology.shear * weight / 3.0) - topology.shear * weight;
            for e in 0..9 {
                p[point][e] = f[point][e] * (topology.shear * weight) + cofactor[e] * by;
            }
        }
        least = least.min(low);
        let (cofactor, ratio) = areas(&f[8]);
        let by = (ratio - 1.0) * (topology.bulk * cell.volume);
        for e in 0..9 {
            p[8][e] = cofactor[e] * by;
        }
        let middle = middle(simd, &m);
        let mut square = zero;
        for e in 0..9 {
            square += middle[e] * middle[e];
        }
        let limited = low.simd_lt(splat(simd, LIMITED_RATIO))
            | (square + square + others * cell.reach).simd_gt(splat(simd, LIMITED_SQUARE));
        if limited.any_true() {
            add_limits::<S>(simd, &topology.unit, weight, &f, &mut p);
        }
        let mut filling = [zero; 9];
        if cell.fill > 0.0 {
            let (cofactor, ratio) = areas(&middle);
            let (mu, both) = (topology.shear * cell.fill, (topology.shear / 3.0 + topology.bulk) * cell.fill);
            let by = (ratio - 1.0) * both - mu;
            for e in 0..9 {
                filling[e] = middle[e] * mu + cofactor[e] * by;
            }
        }
        for k in 0..3 {
            let mut a = [filling[k], filling[3 + k], filling[6 + k], zero, zero, zero, zero];
            if cell.fill > 0.0 {
                let mu = topology.shear * cell.fill;
                for mode in 3..6 {
                    a[mode] = m[k][mode] * (mu * 2.0 / 3.0);
                }
                a[6] = m[k][6] * (mu / 3.0);
            }
            for (at, p) in cell.points.iter().zip(&p) {
                collect(&mut a, at, [p[k], p[3 + k], p[6 + k]]);
            }
            spread(simd, &a, gradient, &cell.nodes, k, part);
        }
    }
    least
}

/// The seven modes of a component of the displacement that F depends on, of which the gradient in a
/// cell of edge 1 is made: x, y, z, xy, xz, yz, xyz.
#[inline(always)]
pub(super) fn modes<S: Simd>(simd: S, u: &[[Block<f32>; 3]], nodes: &[u32; 8], k: usize, part: usize) -> [Reg<S>; 7] {
    let mut v = [splat(simd, 0.0); 8];
    for c in 0..8 {
        v[c] = load(simd, &u[nodes[c] as usize][k], part);
    }
    let (p0, p1, p2, p3) = (v[0] + v[1], v[2] + v[3], v[4] + v[5], v[6] + v[7]);
    let (m0, m1, m2, m3) = (v[1] - v[0], v[3] - v[2], v[5] - v[4], v[7] - v[6]);
    let (pp0, pp1, pm0, pm1) = (p0 + p1, p2 + p3, p1 - p0, p3 - p2);
    let (mp0, mp1, mm0, mm1) = (m0 + m1, m2 + m3, m1 - m0, m3 - m2);
    let all = [mp0 + mp1, pm0 + pm1, pp1 - pp0, mm0 + mm1, mp1 - mp0, pm1 - pm0, mm1 - mm0];
    let mut out = all;
    for mode in 0..7 {
        out[mode] = all[mode] * 0.25;
    }
    out
}

/// The transpose of [`modes`]: adds what the modes' derivatives are at the corners.
#[inline(always)]
fn spread<S: Simd>(
    simd: S,
    a: &[Reg<S>; 7],
    gradient: &mut [[Block<f32>; 3]],
    nodes: &[u32; 8],
    k: usize,
    part: usize,
) {
    let mut b = *a;
    for mode in 0..7 {
        b[mode] = a[mode] * 0.25;
    }
    let [x, y, z, xy, xz, yz, xyz] = b;
    // The sign of a mode at a corner is the product of the signs of its coordinates.
    let (x0, x1) = (x - xz, x + xz);
    let (y0, y1) = (y - yz, y + yz);
    let (w0, w1) = (xy - xyz, xy + xyz);
    let (s0, d0, s1, d1) = (x0 + w0, x0 - w0, x1 + w1, x1 - w1);
    let (l0, h0, l1, h1) = (y0 + z, y0 - z, y1 + z, y1 - z);
    // At z = -1: y0 y - z; at z = 1: y1 y + z.
    let (below0, below1, above0, above1) = (splat(simd, 0.0) - l0, h0, splat(simd, 0.0) - h1, l1);
    let corners =
        [below0 - d0, below0 + d0, below1 - s0, below1 + s0, above0 - d1, above0 + d1, above1 - s1, above1 + s1];
    for c in 0..8 {
        let to = &mut gradient[nodes[c] as usize][k];
        store::<S>(load(simd, to, part) + corners[c], to, part);
    }
}

/// Writes the row `k` of F at a point.
#[inline(always)]
fn deform<S: Simd>(m: &[Reg<S>; 7], at: &Place, unit: [Reg<S>; 3], k: usize, f: &mut Nine<S>) {
    f[k] = m[0] + unit[0] + m[3] * at.y + m[4] * at.z + m[6] * at.yz;
    f[3 + k] = m[1] + unit[1] + m[3] * at.x + m[5] * at.z + m[6] * at.xz;
    f[6 + k] = m[2] + unit[2] + m[4] * at.x + m[5] * at.y + m[6] * at.xy;
}

/// The transpose of [`deform`]: adds what a row of the stress at a point is to the modes.
#[inline(always)]
fn collect<R>(a: &mut [R; 7], at: &Place, p: [R; 3])
where
    R: Copy + std::ops::Mul<f32, Output = R> + std::ops::AddAssign,
{
    a[0] += p[0];
    a[1] += p[1];
    a[2] += p[2];
    a[3] += p[0] * at.y;
    a[4] += p[0] * at.z;
    a[5] += p[1] * at.z;
    a[6] += p[0] * at.yz;
    a[3] += p[1] * at.x;
    a[4] += p[2] * at.x;
    a[5] += p[2] * at.y;
    a[6] += p[1] * at.xz;
    a[6] += p[2] * at.xy;
}

/// F in the middle of the cell.
#[inline(always)]
fn middle<S: Simd>(simd: S, m: &[[Reg<S>; 7]; 3]) -> Nine<S> {
    let one = splat(simd, 1.0);
    [m[0][0] + one, m[1][0], m[2][0], m[0][1], m[1][1] + one, m[2][1], m[0][2], m[1][2], m[2][2] + one]
}

/// The cofactor matrix of F and its determinant.
#[inline(always)]
pub(super) fn areas<R>(f: &[R; 9]) -> ([R; 9], R)
where
    R: Copy + std::ops::Mul<Output = R> + std::ops::Sub<Output = R> + std::ops::Add<Output = R>,
{
    let [a, b, c, d, e, g, h, i, j] = *f;
    let cofactor = [
        e * j - g * i,
        g * h - d * j,
        d * i - e * h,
        c * i - b * j,
        a * j - c * h,
        b * h - a * i,
        b * g - c * e,
        c * d - a * g,
        a * e - b * d,
    ];
    (cofactor, a * cofactor[0] + b * cofactor[1] + c * cofactor[2])
}

/// Adds the limits' stress at the eight points in the lanes where they act.
#[cold]
#[inline(never)]
fn add_limits<S: Simd>(simd: S, unit: &Material, weight: f32, f: &[Nine<S>; 9], p: &mut [Nine<S>; 9]) {
    simd.vectorize(
        #[inline(always)]
        || add_limits_here(simd, unit, weight, f, p),
    );
}

#[inline(always)]
fn add_limits_here<S: Simd>(simd: S, unit: &Material, weight: f32, f: &[Nine<S>; 9], p: &mut [Nine<S>; 9]) {
    for (f, p) in f[..8].iter().zip(&mut p[..8]) {
        let mut square = splat(simd, 0.0);
        for e in 0..9 {
            square += f[e] * f[e];
        }
        let acts = areas(f).1.simd_lt(splat(simd, LIMITED_RATIO)) | square.simd_gt(splat(simd, LIMITED_SQUARE));
        let bits = acts.to_bitmask();
        if bits == 0 {
            continue;
        }
        let mut added = [[0.0f32; 16]; 9];
        for lane in (0..width::<S>()).filter(|lane| bits >> lane & 1 == 1) {
            let numbers: [f64; 9] = std::array::from_fn(|e| f64::from(f[e].as_slice()[lane]));
            if let Some(stress) = unit.limit_stress(DMat3::from_cols_array(&numbers)) {
                for (added, part) in added.iter_mut().zip(stress.to_cols_array()) {
                    added[lane] = part as f32 * weight;
                }
            }
        }
        // Other lanes keep every bit.
        for e in 0..9 {
            p[e] = acts.select(p[e] + Reg::<S>::from_slice(simd, &added[e][..width::<S>()]), p[e]);
        }
    }
}

#[cfg(test)]
mod tests;
