//! St. Venant-Kirchhoff elasticity, the paper's.

use super::Hyperelastic;
use super::volume::trace;
use glam::DMat3;

/// Psi = mu tr(E^2) + lambda/2 tr(E)^2 with Green's strain E = (F'F - I)/2 (paper, section IV-B).
/// Its compressive stress peaks at a stretch of 0.577 and then falls to nothing: it cannot hold a
/// squeezed element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StVenantKirchhoff {
    /// Lame's mu (Pa).
    pub mu: f64,
    /// Lame's lambda (Pa).
    pub lambda: f64,
}

fn green_strain(f: DMat3) -> DMat3 {
    (f.transpose() * f - DMat3::IDENTITY) * 0.5
}

impl Hyperelastic for StVenantKirchhoff {
    fn energy(&self, f: DMat3) -> f64 {
        let e = green_strain(f);
        self.mu * trace(e * e) + 0.5 * self.lambda * trace(e).powi(2)
    }

    fn stress(&self, f: DMat3) -> DMat3 {
        let e = green_strain(f);
        f * (e * (2.0 * self.mu) + DMat3::IDENTITY * (self.lambda * trace(e)))
    }

    fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3 {
        let second = |e: DMat3| e * (2.0 * self.mu) + DMat3::IDENTITY * (self.lambda * trace(e));
        let product = f.transpose() * change;
        change * second(green_strain(f)) + f * second((product + product.transpose()) * 0.5)
    }
}
