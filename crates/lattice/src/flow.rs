//! Viscosity over a step: what the strain since its beginning costs.

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
    pub(crate) before: Vec<[DMat3; 8]>,
}

impl Flow {
    /// Stress F S with S = eta/h (2 E + tr(E) I), E = (C - C0)/2, and the energy density.
    pub(crate) fn stress(&self, f: DMat3, before: &DMat3) -> (f64, DMat3) {
        let strain = (f.transpose() * f - *before) * 0.5;
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        let squares: f64 = strain.to_cols_array().iter().map(|e| e * e).sum();
        let inner = (strain * 2.0 + DMat3::from_diagonal(DVec3::splat(trace))) * self.stiffness;
        (self.stiffness * (squares + 0.5 * trace * trace), f * inner)
    }

    /// Second derivative by two nodes with shape gradients `a` and `b`, without the part that turns
    /// the stress: positive semidefinite.
    pub(crate) fn block(&self, f: DMat3, a: DVec3, b: DVec3) -> DMat3 {
        let (fa, fb) = (f * a, f * b);
        let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        (f * f.transpose() * a.dot(b) + outer(fb, fa) + outer(fa, fb)) * self.stiffness
    }
}
