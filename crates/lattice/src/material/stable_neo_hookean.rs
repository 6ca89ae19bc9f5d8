//! Stable neo-Hookean elasticity in singular values.

use super::Principal;
use glam::{DMat3, DVec3};

/// mu/2 (|F|^2 - 3) - mu (J - 1) + mu/6 (J - 1)^2. The last term belongs to the volume; it makes
/// the linear part mu |dev e|^2.
pub(super) fn deviatoric(mu: f64, s: DVec3) -> Principal {
    let volume = polynomial(s, [-mu, mu / 3.0]);
    // The first two terms cancel to first order; in e = s - 1 they do so without rounding.
    let e = s - DVec3::ONE;
    let products = e.x * e.y + e.y * e.z + e.z * e.x;
    let shape = 0.5 * e.length_squared() - products - e.element_product();
    let change = e.element_sum() + products + e.element_product();
    Principal {
        energy: mu * (shape + change * change / 6.0),
        first: volume.first + mu * s,
        second: volume.second + DMat3::from_diagonal(DVec3::splat(mu)),
        shear: volume.shear + DVec3::splat(mu),
        twist: volume.twist + DVec3::splat(mu),
    }
}

/// K/2 (J - 1)^2.
pub(super) fn volumetric(bulk: f64, s: DVec3) -> Principal {
    polynomial(s, [0.0, bulk])
}

/// a (J - 1) + b/2 (J - 1)^2.
fn polynomial(s: DVec3, [a, b]: [f64; 2]) -> Principal {
    let e = s - DVec3::ONE;
    let change = e.element_sum() + e.x * e.y + e.y * e.z + e.z * e.x + e.element_product();
    Principal { energy: change * (a + 0.5 * b * change), ..of_volume_ratio(s, a + b * change, b) }
}

/// The derivatives of a function of J with this first and second derivative; without its value.
pub(super) fn of_volume_ratio(s: DVec3, slope: f64, curvature: f64) -> Principal {
    let cofactor = DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y);
    let outer = DMat3::from_cols(cofactor * cofactor.x, cofactor * cofactor.y, cofactor * cofactor.z);
    let mixed = DMat3::from_cols(DVec3::new(0.0, s.z, s.y), DVec3::new(s.z, 0.0, s.x), DVec3::new(s.y, s.x, 0.0));
    Principal {
        energy: 0.0,
        first: slope * cofactor,
        second: outer * curvature + mixed * slope,
        shear: -slope * s,
        twist: slope * s,
    }
}
