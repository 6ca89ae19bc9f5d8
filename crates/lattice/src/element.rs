//! One hexahedron: energy, forces and stiffness, by selectively reduced integration.
//!
//! The deviatoric part has eight points, the volumetric part one, at the material's centroid. The
//! empty part of a boundary cell is filled with a fictitious tissue that is softer by the factor
//! [`LatticeOptions::fill`](crate::LatticeOptions), on the Gauss points of the whole cell.

use crate::Hexahedron;
use crate::flow::{Flow, NodeBlocks};
use crate::material::{Material, Part, Principal};
use fearless_simd::{Level, Simd, dispatch};
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::{Svd, nearest_rotation};

/// Offset of Gauss's two points from the middle of a side, over the side.
pub(crate) const GAUSS: f64 = 0.288_675_134_594_812_9;

/// The lower triangle of an element's stiffness: block (a, b) with b <= a lies at a(a+1)/2 + b.
pub(crate) type Blocks = [DMat3; 36];

/// Energy, forces and, on request, stiffness of one element.
#[derive(Clone, Debug)]
pub(crate) struct ElementResult {
    /// (J).
    pub energy: f64,
    /// Gradient by each node's position (N).
    pub gradient: [DVec3; 8],
    /// Second derivative (N/m).
    pub hessian: Option<Box<Blocks>>,
}

/// What of an element is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Energy and gradient.
    Gradient,
    /// The exact second derivative too.
    Exact,
    /// The second derivative projected to be positive semidefinite at each point.
    Projected,
}

/// An element in its cell of edge `cell` (m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element<'a> {
    pub hex: &'a Hexahedron,
    pub cell: f64,
    pub fill: f64,
    pub material: &'a Material,
}

impl Element<'_> {
    /// At the nodes' positions `x` (m).
    pub fn evaluate(&self, x: &[DVec3; 8], wanted: Wanted) -> ElementResult {
        let hessian = (wanted != Wanted::Gradient).then(|| Box::new([DMat3::ZERO; 36]));
        let mut out = ElementResult { energy: 0.0, gradient: [DVec3::ZERO; 8], hessian };
        self.for_points(|u, volume, part| self.add(u, volume, part, x, wanted, &mut out));
        out
    }

    /// Gradients of the shape functions at `u` in the cell (1/m).
    fn gradients(&self, u: DVec3) -> [DVec3; 8] {
        shape_gradients(u, self.cell.recip())
    }

    /// Visits the integration points: place in the cell from 0 to 1, volume (m3), part.
    fn for_points(&self, mut visit: impl FnMut(DVec3, f64, Part)) {
        let whole = self.cell.powi(3);
        let mut rule = |centre: DVec3, spread: DMat3, volume: f64| {
            for corner in CORNERS {
                visit(centre + spread * corner, volume / 8.0, Part::Deviatoric);
            }
            visit(centre, volume, Part::Volumetric);
        };
        rule(self.hex.centre, self.hex.spread, self.hex.fraction * whole);
        let empty = self.fill * (1.0 - self.hex.fraction);
        if empty > 0.0 {
            rule(DVec3::splat(0.5), DMat3::from_diagonal(DVec3::splat(GAUSS)), empty * whole);
        }
    }

    fn add(&self, u: DVec3, volume: f64, part: Part, x: &[DVec3; 8], wanted: Wanted, out: &mut ElementResult) {
        let gradients = self.gradients(u);
        let f = deformation(x, &gradients);
        let svd = Svd::of(f);
        let law = self.material.at(part, svd.s);
        out.energy += volume * law.energy;
        let stress = svd.u * DMat3::from_diagonal(law.first) * svd.v.transpose();
        for (to, g) in out.gradient.iter_mut().zip(&gradients) {
            *to += volume * (stress * *g);
        }
        if let Some(blocks) = &mut out.hessian {
            let law = if wanted == Wanted::Projected { law.projected() } else { law };
            // In the frame of the singular vectors the stiffness is sparse.
            let turned = gradients.map(|g| svd.v.transpose() * g);
            let mut to = blocks.iter_mut();
            for a in 0..8 {
                for b in 0..=a {
                    let Some(to) = to.next() else { return };
                    *to += svd.u * stiffness(&law, turned[a], turned[b]) * svd.u.transpose() * volume;
                }
            }
        }
    }

    /// The rotation of the cell's middle.
    pub fn rotation(&self, x: &[DVec3; 8]) -> DMat3 {
        nearest_rotation(deformation(x, &self.gradients(DVec3::splat(0.5))))
    }

    /// Greatest Frobenius norm of Green's strain (F'F - I)/2 at the points of the deviatoric part.
    pub fn strain(&self, x: &[DVec3; 8]) -> f64 {
        let [xx, yy, zz, xy, yz, zx] = dispatch!(Level::new(), simd => self.green(simd, x));
        let squared = |p: usize| {
            let (diagonal, others) = ([xx[p] - 1.0, yy[p] - 1.0, zz[p] - 1.0], [xy[p], yz[p], zx[p]]);
            diagonal.iter().map(|c| c * c).sum::<f64>() + 2.0 * others.iter().map(|c| c * c).sum::<f64>()
        };
        0.5 * (0..8).map(squared).fold(0.0, f64::max).sqrt()
    }

    /// Adds the stiffness of viscosity.
    pub fn add_viscous(&self, x: &[DVec3; 8], flow: &Flow, blocks: &mut Blocks) {
        dispatch!(Level::new(), simd => self.add_viscous_in(simd, x, flow, blocks));
    }

    #[inline(always)]
    fn add_viscous_in<S: Simd>(&self, simd: S, x: &[DVec3; 8], flow: &Flow, blocks: &mut Blocks) {
        let mut all: NodeBlocks = [[[0.0; 8]; 9]; 8];
        for a in 0..8 {
            for b in 0..=a {
                let block = blocks[a * (a + 1) / 2 + b].to_cols_array();
                for k in 0..9 {
                    all[a][k][b] = block[k];
                }
            }
        }
        let volume = self.hex.fraction * self.cell.powi(3) / 8.0;
        for corner in CORNERS {
            let gradients = self.gradients(self.hex.centre + self.hex.spread * corner);
            flow.add_blocks(simd, deformation(x, &gradients), &gradients, volume, &mut all);
        }
        for a in 0..8 {
            for b in 0..=a {
                let mut block = [0.0; 9];
                for k in 0..9 {
                    block[k] = all[a][k][b];
                }
                blocks[a * (a + 1) / 2 + b] = DMat3::from_cols_array(&block);
            }
        }
    }

    /// Least ratio of volumes J over the integration points of the tissue.
    pub fn least_volume_ratio(&self, x: &[DVec3; 8]) -> f64 {
        let ratio =
            |corner: DVec3| deformation(x, &self.gradients(self.hex.centre + self.hex.spread * corner)).determinant();
        CORNERS.into_iter().map(ratio).fold(f64::INFINITY, f64::min)
    }
}

/// Corners of a cell about its middle.
pub(crate) const CORNERS: [DVec3; 8] = [
    DVec3::new(-1.0, -1.0, -1.0),
    DVec3::new(1.0, -1.0, -1.0),
    DVec3::new(-1.0, 1.0, -1.0),
    DVec3::new(1.0, 1.0, -1.0),
    DVec3::new(-1.0, -1.0, 1.0),
    DVec3::new(1.0, -1.0, 1.0),
    DVec3::new(-1.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, 1.0),
];

/// Gradients of the eight trilinear shape functions at `u` in a cell of which `per_cell` fit into a
/// metre (1/m). Written out: a map over the corners is three times as slow.
fn shape_gradients(u: DVec3, per_cell: f64) -> [DVec3; 8] {
    let (a, b) = (DVec3::ONE - u, u);
    let (c, d) = (a * per_cell, b * per_cell);
    let gradient = |sign: [f64; 3], x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
        DVec3::new(sign[0] * y[1] * z[0], sign[1] * z[1] * x[0], sign[2] * x[1] * y[0])
    };
    let (x0, x1, y0, y1, z0, z1) = ([a.x, c.x], [b.x, d.x], [a.y, c.y], [b.y, d.y], [a.z, c.z], [b.z, d.z]);
    [
        gradient([-1.0, -1.0, -1.0], x0, y0, z0),
        gradient([1.0, -1.0, -1.0], x1, y0, z0),
        gradient([-1.0, 1.0, -1.0], x0, y1, z0),
        gradient([1.0, 1.0, -1.0], x1, y1, z0),
        gradient([-1.0, -1.0, 1.0], x0, y0, z1),
        gradient([1.0, -1.0, 1.0], x1, y0, z1),
        gradient([-1.0, 1.0, 1.0], x0, y1, z1),
        gradient([1.0, 1.0, 1.0], x1, y1, z1),
    ]
}

/// F: the sum of x g^T.
fn deformation(x: &[DVec3; 8], gradients: &[DVec3; 8]) -> DMat3 {
    let mut f = DMat3::ZERO;
    for (x, g) in x.iter().zip(gradients) {
        f += DMat3::from_cols(*x * g.x, *x * g.y, *x * g.z);
    }
    f
}

/// The block of two nodes with shape gradients `a` and `b`, all in the frame of the singular
/// vectors. A change dF = e_j b^T changes the stress on the diagonal by psi_ij, in symmetric shear
/// by `shear` and in rotation by `twist`.
fn stiffness(law: &Principal, a: DVec3, b: DVec3) -> DMat3 {
    let even = 0.5 * (law.shear + law.twist);
    let odd = 0.5 * (law.shear - law.twist);
    let entry = |i: usize, j: usize| {
        let on = law.second.col(j)[i] * a[i] * b[j];
        if i == j {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            on + even[l] * a[k] * b[k] + even[k] * a[l] * b[l]
        } else {
            on + odd[3 - i - j] * a[j] * b[i]
        }
    };
    let column = |j: usize| DVec3::new(entry(0, j), entry(1, j), entry(2, j));
    DMat3::from_cols(column(0), column(1), column(2))
}

#[cfg(test)]
mod tests;
