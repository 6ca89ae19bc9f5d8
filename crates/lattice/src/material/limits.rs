//! What limits strain in both laws: tissue that is squeezed almost flat, or stretched beyond what
//! any organ bears, becomes stiff.
//!
//! With the volume ratio J and the principal stretches s:
//!
//! - below J = 0.2 a barrier, strength/2 ln(J/0.2)^2, which continues as a parabola below J = 0.02,
//!   so that a cell that is inside out is pushed back. Neither law has one: between closing jaws
//!   corotated cells would turn inside out;
//! - mu/2 (s^2 - 16)^2 for every stretch s above 4. Without it a few newtons stretch soft tissue
//!   tenfold.
//!
//! The tetrahedra of `trocar-tissue` have the same limits.

use super::Principal;
use super::stable_neo_hookean::of_volume_ratio;
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::{cofactor, eigen};

/// Square of the principal stretch above which stretch is limited.
pub(super) const MAX_FREE_STRETCH_SQUARED: f64 = 16.0;

/// Volume ratio below which the barrier acts, and below which it is a parabola.
pub(super) const BARRIER_BEGINS: f64 = 0.2;
const PARABOLA_BEGINS: f64 = 0.02;

/// The limits of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Shear modulus (Pa).
    pub mu: f64,
    /// Strength of the barrier (Pa): lambda + mu.
    pub strength: f64,
}

impl Limits {
    /// Energy density (J/m3) and stress (Pa) at F; None where neither acts.
    pub fn stress(&self, f: DMat3) -> Option<(f64, DMat3)> {
        let columns = [f.x_axis, f.y_axis, f.z_axis];
        let square: f64 = columns.iter().map(|c| c.length_squared()).sum();
        let ratio = f.determinant();
        if square <= MAX_FREE_STRETCH_SQUARED && ratio >= BARRIER_BEGINS {
            return None;
        }
        let [energy, slope, _] = self.barrier(ratio);
        let (mut energy, mut stress) = (energy, cofactor(f) * slope);
        if square > MAX_FREE_STRETCH_SQUARED {
            let (squares, axes) = eigen(f.transpose() * f);
            let beyond = beyond(squares);
            energy += 0.5 * self.mu * beyond.length_squared();
            stress += f * axes * DMat3::from_diagonal(2.0 * self.mu * beyond) * axes.transpose();
        }
        Some((energy, stress))
    }

    /// Adds the limits to a law at the singular values `s` of F.
    pub fn add(&self, s: DVec3, to: &mut Principal) {
        let ratio = s.element_product();
        if ratio < BARRIER_BEGINS {
            let [energy, slope, curvature] = self.barrier(ratio);
            let part = of_volume_ratio(s, slope, curvature);
            to.energy += energy;
            to.first += part.first;
            to.second += part.second;
            to.shear += part.shear;
            to.twist += part.twist;
        }
        let beyond = beyond(s * s);
        if beyond == DVec3::ZERO {
            return;
        }
        let first = 2.0 * self.mu * beyond * s;
        let second = |k: usize| if beyond[k] > 0.0 { 2.0 * self.mu * (beyond[k] + 2.0 * s[k] * s[k]) } else { 0.0 };
        to.energy += 0.5 * self.mu * beyond.length_squared();
        to.first += first;
        for k in 0..3 {
            to.second.col_mut(k)[k] += second(k);
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (apart, sum) = (s[i] - s[j], s[i] + s[j]);
            to.shear[k] += if apart.abs() < 1e-9 * sum.abs() { second(i) } else { (first[i] - first[j]) / apart };
            to.twist[k] += if sum == 0.0 { 0.0 } else { (first[i] + first[j]) / sum };
        }
    }

    /// The barrier's energy density at a volume ratio (J/m3), and its first and second derivatives.
    fn barrier(&self, ratio: f64) -> [f64; 3] {
        if ratio >= BARRIER_BEGINS {
            return [0.0; 3];
        }
        let at = ratio.max(PARABOLA_BEGINS);
        let log = libm::log(at / BARRIER_BEGINS);
        let [energy, slope, curvature] =
            [0.5 * log * log, log / at, (1.0 - log) / (at * at)].map(|x| self.strength * x);
        let below = ratio - at;
        [energy + below * (slope + 0.5 * below * curvature), slope + below * curvature, curvature]
    }
}

/// The parts of squared stretches that are beyond the limit.
fn beyond(squares: DVec3) -> DVec3 {
    (squares - DVec3::splat(MAX_FREE_STRETCH_SQUARED)).max(DVec3::ZERO)
}
