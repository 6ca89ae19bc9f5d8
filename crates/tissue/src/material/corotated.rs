//! Fixed corotated elasticity.

use super::Hyperelastic;
use super::stretch::StretchEnergy;
use super::volume::{VolumeEnergy, dot, trace};
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::cofactor;

/// Psi = mu |F - R|^2 + lambda/2 (J - 1)^2, R being the rotation in F = R S.
///
/// Stomakhin, Howes, Schroeder and Teran, "Energetically consistent invertible elasticity", 2012,
/// section 3.3 (their fixed corotated model). Small strains obey Hooke's law with Lame's mu and
/// lambda exactly, and pure shape change costs what linear elasticity says at any rotation. Like
/// [`super::StableNeoHookean`] it is finite for flat elements, so it has the same barrier below a
/// fifth of the rest volume, with (lambda + mu)/2 ln(J/0.2)^2, and the same limit of stretch. It is
/// not defined for inverted elements, which no solver here produces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corotated {
    /// Lame's mu (Pa).
    pub mu: f64,
    /// Lame's lambda (Pa).
    pub lambda: f64,
}

/// Greatest number of steps of the polar decomposition; ten are enough for a condition number of
/// 1e16.
const MAX_POLAR_STEPS: usize = 30;

impl Corotated {
    /// The energy of the volume ratio.
    pub(crate) fn volume(&self) -> VolumeEnergy {
        VolumeEnergy::new(self.lambda, 1.0, self.lambda + self.mu)
    }

    /// The energy of large stretches.
    fn limit(&self) -> StretchEnergy {
        StretchEnergy { mu: self.mu }
    }
}

impl Hyperelastic for Corotated {
    fn energy(&self, f: DMat3) -> f64 {
        let strain = f - rotation(f);
        self.mu * dot(strain, strain) + self.volume().at(f.determinant()).0 + self.limit().energy(f)
    }

    fn stress(&self, f: DMat3) -> DMat3 {
        (f - rotation(f)) * (2.0 * self.mu) + self.volume().stress(f) + self.limit().stress(f)
    }

    /// The rotation itself changes by R skew(w) with (tr(S) I - S) w = axial(R'dF - dF'R) (McAdams
    /// and others, "Efficient elasticity for character skinning", 2011).
    fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3 {
        let r = rotation(f);
        let s = r.transpose() * f;
        let turned = r.transpose() * change;
        let skew = turned - turned.transpose();
        let axial = DVec3::new(skew.y_axis.z, skew.z_axis.x, skew.x_axis.y);
        let w = (DMat3::from_diagonal(DVec3::splat(trace(s))) - s).inverse() * axial;
        let spin = DMat3::from_cols(w.cross(DVec3::X), w.cross(DVec3::Y), w.cross(DVec3::Z));
        (change - r * spin) * (2.0 * self.mu)
            + self.volume().stress_change(f, change)
            + self.limit().stress_change(f, change)
    }
}

/// The rotation R of the polar decomposition F = R S, for det F above 0: Newton's iteration with
/// Frobenius scaling (Higham, "Computing the polar decomposition", 1986). For a singular F it is
/// not finite.
fn rotation(f: DMat3) -> DMat3 {
    let mut x = f;
    for _ in 0..MAX_POLAR_STEPS {
        let cofactor = cofactor(x);
        let inverse = cofactor * (1.0 / x.x_axis.dot(cofactor.x_axis));
        let scale = (dot(inverse, inverse) / dot(x, x)).sqrt().sqrt();
        let next = (x * scale + inverse * (1.0 / scale)) * 0.5;
        let change = next - x;
        x = next;
        // It converges quadratically: the remaining error is the square of this.
        if dot(change, change) < 1e-18 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn rotations_are_found_and_cost_nothing() {
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 2.9, -1.1, 0.4));
        for stretch in [[1.0, 1.0, 1.0], [3.0, 0.2, 1.0], [1e-3, 1.0, 2.0], [1e-5, 1e-4, 5.0]] {
            let basis = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.9, -2.0));
            let s = basis * DMat3::from_diagonal(DVec3::from_array(stretch)) * basis.transpose();
            let error = rotation(turn * s) - turn;
            // Rounding of F turns it by about epsilon over the two smallest stretches.
            let least = stretch[0] + stretch[1];
            assert!(dot(error, error).sqrt() < 1e-14 / least.min(1.0), "{stretch:?}: {error}");
        }
        assert!(Corotated { mu: 4e3, lambda: 2e4 }.energy(turn).abs() < 1e-20);
    }
}
