//! Stable neo-Hookean elasticity.

use super::Hyperelastic;
use glam::DMat3;

/// Psi = mu/2 (tr(F'F) - 3) + lambda'/2 (J - alpha)^2 - const, alpha = 1 + mu/lambda'.
///
/// Smith, De Goes and Kim, "Stable neo-Hookean flesh simulation", 2018, without the logarithmic term, which only matters at the origin of F. It is finite for
/// flat and inverted elements and pushes them back. Its linearisation at rest is 2 mu eps + (lambda' - mu) tr(eps) I, so lambda' = lambda + mu
/// makes small strains obey Hooke's law with Lame's mu and lambda exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Shear modulus [Pa].
    pub mu: f64,
    /// Volume modulus lambda' [Pa].
    pub lambda: f64,
    /// Volume ratio towards which the volume term pulls; above 1, it balances the first term at rest.
    pub alpha: f64,
}

impl StableNeoHookean {
    /// From Lame's parameters [Pa].
    pub fn new(mu: f64, lame_lambda: f64) -> Self {
        let lambda = lame_lambda + mu;
        Self { mu, lambda, alpha: 1.0 + mu / lambda }
    }
}

impl Hyperelastic for StableNeoHookean {
    fn energy(&self, f: DMat3) -> f64 {
        let trace = f.to_cols_array().iter().map(|x| x * x).sum::<f64>();
        let volume = |j: f64| 0.5 * self.lambda * (j - self.alpha) * (j - self.alpha);
        0.5 * self.mu * (trace - 3.0) + volume(f.determinant()) - volume(1.0)
    }

    fn stress(&self, f: DMat3) -> DMat3 {
        f * self.mu + cofactor(f) * (self.lambda * (f.determinant() - self.alpha))
    }
}

/// The cofactor matrix dJ/dF.
fn cofactor(f: DMat3) -> DMat3 {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}
