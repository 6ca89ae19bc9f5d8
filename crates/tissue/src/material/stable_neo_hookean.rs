//! Stable neo-Hookean elasticity.

use super::Hyperelastic;
use super::stretch::StretchEnergy;
use super::volume::VolumeEnergy;
use glam::DMat3;

/// Psi = mu/2 (tr(F'F) - 3) + lambda'/2 (J - alpha)^2 - const, alpha = 1 + mu/lambda'.
///
/// Smith, De Goes and Kim, "Stable neo-Hookean flesh simulation", 2018, without the logarithmic
/// term, which only matters at the origin of F. The energy is finite for flat elements, though, and
/// an element between a rigid grasp and pinned tissue can be pulled flat; so a barrier lambda'/2
/// ln(J/0.2)^2 is added below a fifth of the rest volume. Beyond a stretch of 4 tissue becomes
/// stiff: mu/2 (s^2 - 16)^2 is added for each principal stretch s there. The linearisation at rest
/// is 2 mu eps + (lambda' - mu) tr(eps) I, so lambda' = lambda + mu makes small strains obey
/// Hooke's law with Lame's mu and lambda exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Shear modulus (Pa).
    pub mu: f64,
    /// Volume modulus lambda' (Pa).
    pub lambda: f64,
    /// Volume ratio at which the volume term is least; above 1, because it balances the first term
    /// at rest.
    pub alpha: f64,
}

impl StableNeoHookean {
    /// From Lame's parameters (Pa).
    pub fn new(mu: f64, lame_lambda: f64) -> Self {
        let lambda = lame_lambda + mu;
        Self { mu, lambda, alpha: 1.0 + mu / lambda }
    }

    /// Energy density of the volume ratio J (J/m3), and its first and second derivatives; convex
    /// for J above 0.
    pub fn volume_term(&self, j: f64) -> (f64, f64, f64) {
        self.volume().at(j)
    }

    /// The energy of the volume ratio.
    pub(crate) fn volume(&self) -> VolumeEnergy {
        VolumeEnergy::new(self.lambda, self.alpha, self.lambda)
    }

    /// The energy of large stretches.
    fn limit(&self) -> StretchEnergy {
        StretchEnergy { mu: self.mu }
    }
}

impl Hyperelastic for StableNeoHookean {
    fn energy(&self, f: DMat3) -> f64 {
        let trace = f.to_cols_array().iter().map(|x| x * x).sum::<f64>();
        0.5 * self.mu * (trace - 3.0) + self.volume_term(f.determinant()).0 - self.volume_term(1.0).0
            + self.limit().energy(f)
    }

    fn stress(&self, f: DMat3) -> DMat3 {
        f * self.mu + self.volume().stress(f) + self.limit().stress(f)
    }

    fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3 {
        change * self.mu + self.volume().stress_change(f, change) + self.limit().stress_change(f, change)
    }
}
