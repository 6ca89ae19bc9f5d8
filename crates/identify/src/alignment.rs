//! The rigid motion that brings a curve to another.

use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::nearest_rotation;

/// A rigid motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Its rotation.
    pub rotation: DMat3,
    from: DVec3,
    to: DVec3,
    /// The median distance that is left (m).
    pub left: f64,
}

impl Alignment {
    /// The rigid motion that brings `points` nearest to `others` (m) in the least-squares sense (W.
    /// Kabsch, 1976).
    pub fn of(points: &[DVec3], others: &[DVec3]) -> Self {
        let middle = |of: &[DVec3]| of.iter().sum::<DVec3>() / of.len().max(1) as f64;
        let (from, to) = (middle(points), middle(others));
        let mut spread = DMat3::ZERO;
        for (p, q) in points.iter().zip(others) {
            let (p, q) = (*p - from, *q - to);
            spread += DMat3::from_cols(q * p.x, q * p.y, q * p.z);
        }
        let mut made = Self { rotation: nearest_rotation(spread), from, to, left: f64::NAN };
        let left: Vec<f64> = points.iter().zip(others).map(|(p, q)| made.apply(*p).distance(*q)).collect();
        made.left = trocar_core::median(left).unwrap_or(f64::NAN);
        made
    }

    /// Where a point comes to (m).
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * (point - self.from) + self.to
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn a_turned_and_moved_curve_is_brought_back() {
        let curve: Vec<DVec3> = (0..40)
            .map(|i| {
                let t = f64::from(i) / 39.0;
                DVec3::new(0.08 * t, 0.03 * (2.0 * t).sin(), 0.01 * t * t)
            })
            .collect();
        let turn = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_z(-1.2));
        let moved: Vec<DVec3> = curve.iter().map(|p| turn * *p + DVec3::new(0.1, -0.2, 0.3)).collect();
        let alignment = Alignment::of(&curve, &moved);
        assert!(alignment.left < 1e-12, "{}", alignment.left);
        assert!(alignment.apply(curve[7]).distance(moved[7]) < 1e-12);
    }
}
