//! Viscosity over a step: what the strain since its beginning costs.

use crate::points::{Lanes, Matrix, PointValues, Symmetric, squared};
use fearless_simd::{Simd, SimdBase};
use glam::{DMat3, DVec3};

/// The viscous part of a step of implicit Euler.
///
/// A tissue of shear viscosity eta dissipates eta (2 D:D + tr(D)^2) a volume for a rate of strain
/// D, as the dashpots of `trocar-tissue` do on an isotropic mesh. The rate is that of Green's
/// strain over the step, (C - C0)/(2 h) with C = F'F, which no rotation changes. The potential of
/// the step is h eta (D:D + tr(D)^2/2) a volume.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    /// eta/h (Pa).
    pub(crate) stiffness: f64,
    /// C0 at the points of the deviatoric part, hexahedron by hexahedron.
    pub(crate) before: Vec<Symmetric>,
}

impl Flow {
    /// Adds the stress F S with S = eta/h (2 E + tr(E) I), E = (C - C0)/2, at the eight points;
    /// returns the energy density.
    #[inline(always)]
    pub(crate) fn add_stress<S: Simd>(
        &self,
        simd: S,
        f: &Matrix<Lanes<S>>,
        before: &Symmetric,
        stress: &mut Matrix<Lanes<S>>,
    ) -> Lanes<S> {
        let mut twice = squared(f);
        for k in 0..6 {
            twice[k] -= Lanes::<S>::from_slice(simd, &before[k]);
        }
        let [xx, yy, zz, xy, yz, zx] = twice;
        let trace = (xx + yy + zz) * 0.5;
        let inner = [[xx + trace, xy, zx], [xy, yy + trace, yz], [zx, yz, zz + trace]];
        for column in 0..3 {
            let by = &inner[column];
            for row in 0..3 {
                let push = f[0][row] * by[0] + f[1][row] * by[1] + f[2][row] * by[2];
                stress[column][row] += push * self.stiffness;
            }
        }
        let squares = (xx * xx + yy * yy + zz * zz + (xy * xy + yz * yz + zx * zx) * 2.0) * 0.25;
        (squares + trace * trace * 0.5) * self.stiffness
    }

    /// Second derivatives by each two nodes with these shape gradients where the tissue is at `f`,
    /// without the part that turns the stress: positive semidefinite. Adds them, times a `volume`.
    #[inline(always)]
    pub(crate) fn add_blocks<S: Simd>(
        &self,
        simd: S,
        f: DMat3,
        gradients: &[DVec3; 8],
        volume: f64,
        blocks: &mut NodeBlocks,
    ) {
        let (squared, turned) = (f * f.transpose(), gradients.map(|gradient| f * gradient));
        let (squared, all, all_turned) = (squared.to_cols_array(), lanes(simd, gradients), lanes(simd, &turned));
        for a in 0..8 {
            let (own, by) = (gradients[a].to_array(), turned[a].to_array());
            let along = all[0] * own[0] + all[1] * own[1] + all[2] * own[2];
            for column in 0..3 {
                for row in 0..3 {
                    let k = 3 * column + row;
                    let block = along * squared[k] + all_turned[row] * by[column] + all_turned[column] * by[row];
                    let sum = Lanes::<S>::from_slice(simd, &blocks[a][k]) + block * self.stiffness * volume;
                    sum.store_slice(&mut blocks[a][k]);
                }
            }
        }
    }
}

/// A block of each node with each node: column by column, the other nodes in the lanes.
pub(crate) type NodeBlocks = [[PointValues; 9]; 8];

/// The coordinates of eight vectors in lanes.
#[inline(always)]
fn lanes<S: Simd>(simd: S, vectors: &[DVec3; 8]) -> [Lanes<S>; 3] {
    let mut all = [Lanes::<S>::splat(simd, 0.0); 3];
    for axis in 0..3 {
        let mut along = [0.0; 8];
        for k in 0..8 {
            along[k] = vectors[k][axis];
        }
        all[axis] = Lanes::<S>::from_slice(simd, &along);
    }
    all
}
