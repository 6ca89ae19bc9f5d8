//! The limit of stretch, which both laws have.

use super::Principal;
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::eigen;

/// Square of the principal stretch above which it acts.
const MAX_FREE_STRETCH_SQUARED: f64 = 16.0;

/// Energy density (J/m3) and stress (Pa) at F of mu/2 (s^2 - 16)^2 for every principal stretch s
/// above 4; None below. No organ bears such a stretch; without the limit a few newtons stretch soft
/// tissue tenfold.
pub(super) fn limit(mu: f64, f: DMat3) -> Option<(f64, DMat3)> {
    let columns = [f.x_axis, f.y_axis, f.z_axis];
    if columns.iter().map(|c| c.length_squared()).sum::<f64>() <= MAX_FREE_STRETCH_SQUARED {
        return None;
    }
    let (squares, axes) = eigen(f.transpose() * f);
    let beyond = beyond(squares);
    let stress = f * axes * DMat3::from_diagonal(2.0 * mu * beyond) * axes.transpose();
    Some((0.5 * mu * beyond.length_squared(), stress))
}

/// The parts of squared stretches that are beyond the limit.
fn beyond(squares: DVec3) -> DVec3 {
    (squares - DVec3::splat(MAX_FREE_STRETCH_SQUARED)).max(DVec3::ZERO)
}

/// Adds the limit to a law at the singular values `s` of F.
pub(super) fn add(mu: f64, s: DVec3, to: &mut Principal) {
    let beyond = beyond(s * s);
    if beyond == DVec3::ZERO {
        return;
    }
    let first = 2.0 * mu * beyond * s;
    to.energy += 0.5 * mu * beyond.length_squared();
    to.first += first;
    for k in 0..3 {
        let second = if beyond[k] > 0.0 { 2.0 * mu * (beyond[k] + 2.0 * s[k] * s[k]) } else { 0.0 };
        to.second.col_mut(k)[k] += second;
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (apart, sum) = (s[i] - s[j], s[i] + s[j]);
        let near = apart.abs() < 1e-9 * sum.abs();
        let same = 2.0 * mu * (beyond[i] + if beyond[i] > 0.0 { 2.0 * s[i] * s[i] } else { 0.0 });
        to.shear[k] += if near { same } else { (first[i] - first[j]) / apart };
        to.twist[k] += if sum == 0.0 { 0.0 } else { (first[i] + first[j]) / sum };
    }
}
