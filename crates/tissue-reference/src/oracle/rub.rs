//! Friction at one contact, with its limit held.

use glam::{DMat3, DVec3};

/// A spring towards where friction holds a point, and the limit beyond, as a potential.
pub(super) struct Rub {
    /// (J)
    pub energy: f64,
    /// (N)
    pub gradient: DVec3,
    /// (N/m)
    pub hessian: DMat3,
    /// The quadratic that touches the energy at this slide and at the opposite one, and lies above
    /// it everywhere (N/m): the block of the sweeps.
    pub secant: DMat3,
}

impl Rub {
    /// At a contact with this unit `normal`: `motion` is the way from where friction holds it (m),
    /// `limit` the greatest force (N), `stiffness` the spring's (N/m).
    pub fn new(normal: DVec3, motion: DVec3, limit: f64, stiffness: f64) -> Self {
        let slide = motion - motion.dot(normal) * normal;
        let length = slide.length();
        let across = DMat3::IDENTITY - outer(normal);
        let (energy, drag, softening) = if length * stiffness < limit {
            (0.5 * stiffness * length * length, stiffness, 0.0)
        } else {
            (limit * (length - 0.5 * limit / stiffness), limit / length, limit / length)
        };
        let secant = across * drag;
        let hessian = secant - outer(slide.normalize_or_zero()) * softening;
        Self { energy, gradient: drag * slide, hessian, secant }
    }
}

/// How far the place where friction holds a point follows it (m), if the spring stretches by no
/// more than `most`.
pub(super) fn dragged(normal: DVec3, off: DVec3, most: f64) -> DVec3 {
    let slide = off - off.dot(normal) * normal;
    let length = slide.length();
    if length > most { slide * (1.0 - most / length) } else { DVec3::ZERO }
}

pub(super) fn outer(n: DVec3) -> DMat3 {
    DMat3::from_cols(n * n.x, n * n.y, n * n.z)
}
