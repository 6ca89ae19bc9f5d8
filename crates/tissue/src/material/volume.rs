//! The volume part of a stored energy, shared by the materials that have one, and the algebra of
//! the volume ratio J = det F.

use glam::DMat3;
use trocar_geometry::symmetric::cofactor;

/// Volume ratio below which the barrier acts, and its strength over the material's volume modulus.
const BARRIER_BEGINS: f64 = 0.2;
const BARRIER_STRENGTH: f64 = 1.0;

/// modulus/2 (J - alpha)^2, and below a fifth of the rest volume a barrier strength/2 ln(J/0.2)^2:
/// the quadratic is finite for flat elements, and an element between a rigid grasp and pinned
/// tissue can be pulled flat. Convex for J above 0, NaN below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VolumeEnergy {
    /// Volume modulus (Pa).
    pub modulus: f64,
    /// Volume ratio at which the quadratic is least.
    pub alpha: f64,
    /// The barrier's strength (Pa).
    pub strength: f64,
}

impl VolumeEnergy {
    /// With the barrier for tissue of volume modulus `stiffness` (Pa).
    pub fn new(modulus: f64, alpha: f64, stiffness: f64) -> Self {
        Self { modulus, alpha, strength: BARRIER_STRENGTH * stiffness }
    }

    /// Energy density of the volume ratio J (J/m3), and its first and second derivatives.
    pub fn at(&self, j: f64) -> (f64, f64, f64) {
        let d = j - self.alpha;
        let (mut energy, mut slope, mut curvature) = (0.5 * self.modulus * d * d, self.modulus * d, self.modulus);
        if j < BARRIER_BEGINS {
            let log = libm::log(j / BARRIER_BEGINS);
            energy += 0.5 * self.strength * log * log;
            slope += self.strength * log / j;
            curvature += self.strength * (1.0 - log) / (j * j);
        }
        (energy, slope, curvature)
    }

    /// Its part of the stress: slope dJ/dF (Pa).
    pub fn stress(&self, f: DMat3) -> DMat3 {
        cofactor(f) * self.at(f.determinant()).1
    }

    /// First-order change of [`Self::stress`] when F changes by `change` (Pa).
    pub fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3 {
        let (_, slope, curvature) = self.at(f.determinant());
        let cofactor = cofactor(f);
        cofactor * (curvature * dot(cofactor, change)) + cofactor_change(f, change) * slope
    }
}

/// First-order change of the cofactor matrix when F changes by `change`.
fn cofactor_change(f: DMat3, change: DMat3) -> DMat3 {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    let [da, db, dc] = [change.x_axis, change.y_axis, change.z_axis];
    DMat3::from_cols(db.cross(c) + b.cross(dc), dc.cross(a) + c.cross(da), da.cross(b) + a.cross(db))
}

/// Sum of the products of the entries.
pub(crate) fn dot(a: DMat3, b: DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

/// Sum of the diagonal.
pub(crate) fn trace(m: DMat3) -> f64 {
    m.x_axis.x + m.y_axis.y + m.z_axis.z
}
