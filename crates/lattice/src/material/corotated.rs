//! Rotated linear elasticity in singular values. S - I has the eigenvalues s - 1.

use super::Principal;
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::nearest_rotation;

/// mu (|S - I|^2 - tr(S - I)^2/3) = mu |dev S|^2.
pub(super) fn deviatoric(mu: f64, s: DVec3) -> Principal {
    let trace = s.element_sum() - 3.0;
    let strain = s - DVec3::ONE;
    let first = 2.0 * mu * (strain - DVec3::splat(trace / 3.0));
    let ones = DMat3::from_cols(DVec3::ONE, DVec3::ONE, DVec3::ONE);
    Principal {
        energy: mu * (strain.length_squared() - trace * trace / 3.0),
        first,
        second: DMat3::from_diagonal(DVec3::splat(2.0 * mu)) - ones * (2.0 / 3.0 * mu),
        shear: DVec3::splat(2.0 * mu),
        twist: pair_sums(first) / pair_sums(s),
    }
}

/// K/2 tr(S - I)^2.
pub(super) fn volumetric(bulk: f64, s: DVec3) -> Principal {
    let trace = s.element_sum() - 3.0;
    let first = DVec3::splat(bulk * trace);
    Principal {
        energy: 0.5 * bulk * trace * trace,
        first,
        second: DMat3::from_cols(DVec3::ONE, DVec3::ONE, DVec3::ONE) * bulk,
        shear: DVec3::ZERO,
        twist: pair_sums(first) / pair_sums(s),
    }
}

/// The rotation R of F, and tr(S - I).
pub(super) fn stretch(f: DMat3) -> (DMat3, f64) {
    let turn = nearest_rotation(f);
    let off = f - turn;
    (turn, (0..3).map(|c| turn.col(c).dot(off.col(c))).sum())
}

/// Energy density and stress of the deviatoric part at F.
pub(super) fn shear(mu: f64, f: DMat3) -> (f64, DMat3) {
    let (turn, trace) = stretch(f);
    let off = f - turn;
    let squares: f64 = off.to_cols_array().iter().map(|e| e * e).sum();
    (mu * (squares - trace * trace / 3.0), (off - turn * (trace / 3.0)) * (2.0 * mu))
}

/// Sums of the two other coordinates.
fn pair_sums(v: DVec3) -> DVec3 {
    DVec3::new(v.y + v.z, v.z + v.x, v.x + v.y)
}
