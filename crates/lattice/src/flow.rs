//! Viscosity over a step: what the strain since its beginning costs.

use crate::element::Blocks;
use crate::points::{Lanes, Matrix, Symmetric, squared};
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
    /// without the part that turns the stress: positive semidefinite. Adds those of the lower
    /// triangle, row by row, times a `volume`.
    pub(crate) fn add_blocks(&self, f: DMat3, gradients: &[DVec3; 8], volume: f64, blocks: &mut Blocks) {
        let (squared, turned) = (f * f.transpose(), gradients.map(|gradient| f * gradient));
        let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        for a in 0..8 {
            for b in 0..=a {
                let (fa, fb) = (turned[a], turned[b]);
                let block = squared * gradients[a].dot(gradients[b]) + outer(fb, fa) + outer(fa, fb);
                blocks[a * (a + 1) / 2 + b] += block * self.stiffness * volume;
            }
        }
    }
}
