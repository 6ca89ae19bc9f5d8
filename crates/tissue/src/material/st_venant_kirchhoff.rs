//! St. Venant-Kirchhoff elasticity, the paper's.

use super::Hyperelastic;
use glam::DMat3;

/// Psi = mu tr(E^2) + lambda/2 tr(E)^2 with Green's strain E = (F'F - I)/2 (paper, section IV-B). Its compressive stress peaks at a
/// stretch of 0.577 and then falls to nothing: it cannot hold a squeezed element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StVenantKirchhoff {
    /// Lame's mu [Pa].
    pub mu: f64,
    /// Lame's lambda [Pa].
    pub lambda: f64,
}

fn green_strain(f: DMat3) -> DMat3 {
    (f.transpose() * f - DMat3::IDENTITY) * 0.5
}

fn trace(m: DMat3) -> f64 {
    m.x_axis.x + m.y_axis.y + m.z_axis.z
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
}
