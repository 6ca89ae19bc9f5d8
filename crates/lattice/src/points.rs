//! Energy and forces of a hexahedron, its eight points in the lanes of a register.
//!
//! F is a sum over the twelve edges of the cell: along an edge one coordinate changes, and the
//! edge's weight is a product of the two others. The same functions serve the single point of the
//! volumetric part.
//!
//! Nothing is fused and lanes are summed in a fixed order, so all instruction sets give the same
//! bits.

use crate::element::{CORNERS, Element, GAUSS};
use crate::flow::Flow;
use fearless_simd::{Simd, SimdBase, f64x8};
use glam::{DMat3, DVec3};
use std::ops::{Add, Mul, Sub};

/// Numbers at the eight points.
pub(crate) type Lanes<S> = f64x8<S>;

/// The same in memory.
pub(crate) type PointValues = [f64; 8];

/// A symmetric matrix at the eight points: xx, yy, zz, xy, yz, zx.
pub(crate) type Symmetric = [PointValues; 6];

/// A number, or one at each of the eight points.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Add<f64, Output = Self> + Mul<f64, Output = Self>
{
}

impl<T> Number for T where
    T: Copy
        + Add<Output = Self>
        + Sub<Output = Self>
        + Mul<Output = Self>
        + Add<f64, Output = Self>
        + Mul<f64, Output = Self>
{
}

/// A matrix by columns.
pub(crate) type Matrix<T> = [[T; 3]; 3];

/// Corners at the ends of the edges along each axis. Edges differ in the two other coordinates, of
/// which the first changes first.
const EDGES: [[[usize; 2]; 4]; 3] =
    [[[0, 1], [2, 3], [4, 5], [6, 7]], [[0, 2], [1, 3], [4, 6], [5, 7]], [[0, 4], [1, 5], [2, 6], [3, 7]]];

/// The other two axes.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Signs of the corners along an axis, in the order of the lanes.
const SIGNS: [PointValues; 3] = [
    [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0],
    [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
];

/// The vectors along the edges of a cell with its nodes at `x` (m).
type EdgeVectors = [[DVec3; 4]; 3];

/// An integration rule: eight points about a centre, in cells, and their volume (m3).
struct Rule {
    centre: DVec3,
    spread: DMat3,
    volume: f64,
}

impl Element<'_> {
    /// Energy (J), its gradient by each node's position (N), the viscous part included if the
    /// strains before are given, and the least ratio of volumes. The same as [`Self::evaluate`],
    /// without singular values.
    #[inline(always)]
    pub fn forces<S: Simd>(
        &self,
        simd: S,
        x: &[DVec3; 8],
        before: Option<(&Flow, &Symmetric)>,
    ) -> (f64, [DVec3; 8], f64) {
        let edges = edge_vectors(x);
        let mut on_edges = [[DVec3::ZERO; 4]; 3];
        let (mut energy, least) = self.add_rule(simd, &self.tissue(), &edges, before, &mut on_edges);
        let empty = self.fill * (1.0 - self.hex.fraction);
        if empty > 0.0 {
            let (centre, spread) = (DVec3::splat(0.5), DMat3::from_diagonal(DVec3::splat(GAUSS)));
            let rule = Rule { centre, spread, volume: empty * self.cell.powi(3) };
            energy += self.add_rule(simd, &rule, &edges, None, &mut on_edges).0;
        }
        let mut gradient = [DVec3::ZERO; 8];
        for axis in 0..3 {
            for k in 0..4 {
                let [from, to] = EDGES[axis][k];
                gradient[from] -= on_edges[axis][k];
                gradient[to] += on_edges[axis][k];
            }
        }
        (energy, gradient, least)
    }

    /// C = F'F at the points of the tissue's deviatoric part.
    #[inline(always)]
    pub fn green<S: Simd>(&self, simd: S, x: &[DVec3; 8]) -> Symmetric {
        let rule = self.tissue();
        let f = deformation(&weights(rule.points(simd), self.cell.recip()), &edge_vectors(x));
        let mut all = [[0.0; 8]; 6];
        let c = squared(&f);
        for k in 0..6 {
            c[k].store_slice(&mut all[k]);
        }
        all
    }

    /// The rule of the cell's tissue.
    #[inline(always)]
    fn tissue(&self) -> Rule {
        let hex = self.hex;
        Rule { centre: hex.centre, spread: hex.spread, volume: hex.fraction * self.cell.powi(3) }
    }

    /// Adds the forces along the edges at the points of a rule; returns its energy and the least
    /// ratio of volumes.
    #[inline(always)]
    fn add_rule<S: Simd>(
        &self,
        simd: S,
        rule: &Rule,
        edges: &EdgeVectors,
        before: Option<(&Flow, &Symmetric)>,
        to: &mut EdgeVectors,
    ) -> (f64, f64) {
        let per_cell = self.cell.recip();
        let at = weights(rule.points(simd), per_cell);
        let f = deformation(&at, edges);
        let areas = cofactor(&f);
        let ratio = dot(&f[0], &areas[0]);
        let (mut density, mut stress) = self.material.deviatoric(simd, &f, &areas, ratio);
        if let Some((flow, before)) = before {
            density += flow.add_stress(simd, &f, before, &mut stress);
        }
        let volume = rule.volume / 8.0;
        for axis in 0..3 {
            for k in 0..4 {
                let weight = at[axis][k] * volume;
                to[axis][k] += DVec3::new(
                    sum(stress[axis][0] * weight),
                    sum(stress[axis][1] * weight),
                    sum(stress[axis][2] * weight),
                );
            }
        }
        let at = weights(rule.centre.to_array(), per_cell);
        let f = deformation(&at, edges).map(DVec3::from_array);
        let (middle, stress) = self.material.volumetric(DMat3::from_cols(f[0], f[1], f[2]));
        let stress = [stress.x_axis, stress.y_axis, stress.z_axis];
        for axis in 0..3 {
            for k in 0..4 {
                to[axis][k] += (at[axis][k] * rule.volume) * stress[axis];
            }
        }
        (volume * sum(density) + rule.volume * middle, least(ratio))
    }
}

impl Rule {
    /// The places of its points.
    #[inline(always)]
    fn points<S: Simd>(&self, simd: S) -> [Lanes<S>; 3] {
        let signs = [
            Lanes::<S>::from_slice(simd, &SIGNS[0]),
            Lanes::<S>::from_slice(simd, &SIGNS[1]),
            Lanes::<S>::from_slice(simd, &SIGNS[2]),
        ];
        let mut points = [Lanes::<S>::splat(simd, 0.0); 3];
        for k in 0..3 {
            let along = [self.spread.x_axis[k], self.spread.y_axis[k], self.spread.z_axis[k]];
            points[k] = signs[0] * along[0] + signs[1] * along[1] + signs[2] * along[2] + self.centre[k];
        }
        points
    }
}

/// The vectors along the edges.
#[inline(always)]
fn edge_vectors(x: &[DVec3; 8]) -> EdgeVectors {
    let mut vectors = [[DVec3::ZERO; 4]; 3];
    for axis in 0..3 {
        for k in 0..4 {
            let [from, to] = EDGES[axis][k];
            vectors[axis][k] = x[to] - x[from];
        }
    }
    vectors
}

/// The weights of the edges at `u` in a cell of which `per_cell` fit into a metre (1/m).
#[inline(always)]
fn weights<T: Number>(u: [T; 3], per_cell: f64) -> [[T; 4]; 3] {
    let far = u;
    let near = [u[0] * -1.0 + 1.0, u[1] * -1.0 + 1.0, u[2] * -1.0 + 1.0];
    let mut all = [[u[0]; 4]; 3];
    for axis in 0..3 {
        let [p, q] = OTHERS[axis];
        let (near_q, far_q) = (near[q] * per_cell, far[q] * per_cell);
        all[axis] = [near[p] * near_q, far[p] * near_q, near[p] * far_q, far[p] * far_q];
    }
    all
}

/// F by columns.
#[inline(always)]
fn deformation<T: Number>(weights: &[[T; 4]; 3], edges: &EdgeVectors) -> Matrix<T> {
    let mut f = [[weights[0][0]; 3]; 3];
    for axis in 0..3 {
        let (w, d) = (&weights[axis], &edges[axis]);
        for row in 0..3 {
            f[axis][row] = w[0] * d[0][row] + w[1] * d[1][row] + w[2] * d[2][row] + w[3] * d[3][row];
        }
    }
    f
}

/// The derivative of the determinant.
#[inline(always)]
fn cofactor<T: Number>(f: &Matrix<T>) -> Matrix<T> {
    [cross(&f[1], &f[2]), cross(&f[2], &f[0]), cross(&f[0], &f[1])]
}

/// The cross product.
#[inline(always)]
fn cross<T: Number>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The product of two vectors.
#[inline(always)]
pub(crate) fn dot<T: Number>(a: &[T; 3], b: &[T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// F'F: xx, yy, zz, xy, yz, zx.
#[inline(always)]
pub(crate) fn squared<T: Number>(f: &Matrix<T>) -> [T; 6] {
    let [x, y, z] = f;
    [dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(y, z), dot(z, x)]
}

/// The sum over the points.
#[inline(always)]
fn sum<S: Simd>(lanes: Lanes<S>) -> f64 {
    let mut x = [0.0; 8];
    lanes.store_slice(&mut x);
    ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]))
}

/// The least of the points.
#[inline(always)]
fn least<S: Simd>(lanes: Lanes<S>) -> f64 {
    let mut x = [0.0; 8];
    lanes.store_slice(&mut x);
    let mut least = x[0];
    for other in x {
        least = least.min(other);
    }
    least
}

/// Adds to the energy density and the stress at each point what `of` says for its F. Points are
/// computed one after the other.
#[inline(always)]
pub(crate) fn add_at_points<S: Simd>(
    simd: S,
    f: &Matrix<Lanes<S>>,
    (density, stress): (&mut Lanes<S>, &mut Matrix<Lanes<S>>),
    of: impl Fn(DMat3) -> Option<(f64, DMat3)>,
) {
    let mut entries = [[0.0; 8]; 9];
    for k in 0..9 {
        f[k / 3][k % 3].store_slice(&mut entries[k]);
    }
    let (mut energies, mut pushes) = ([0.0; 8], [[0.0; 8]; 9]);
    for point in 0..CORNERS.len() {
        let f = DMat3::from_cols_array(&std::array::from_fn(|k| entries[k][point]));
        if let Some((energy, push)) = of(f) {
            energies[point] = energy;
            for (k, push) in push.to_cols_array().into_iter().enumerate() {
                pushes[k][point] = push;
            }
        }
    }
    *density += Lanes::<S>::from_slice(simd, &energies);
    for k in 0..9 {
        stress[k / 3][k % 3] += Lanes::<S>::from_slice(simd, &pushes[k]);
    }
}
