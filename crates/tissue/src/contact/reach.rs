//! Bounds of shapes, for finding quickly what is near.

use super::Shape;
use glam::DVec3;

impl Shape {
    /// Whether a point is certainly more than `reach` [m] from the shape.
    pub(crate) fn is_farther(&self, p: DVec3, reach: f64) -> bool {
        self.bounding_sphere().is_some_and(|(centre, radius)| (p - centre).length_squared() > (radius + reach).powi(2))
    }

    /// Largest distance of any of its points from its frame's origin [m]; 0 for a half-space, whose turning is not bounded.
    pub(crate) fn extent(&self) -> f64 {
        self.bounding_sphere().map_or(0.0, |(centre, radius)| centre.length() + radius)
    }

    fn bounding_sphere(&self) -> Option<(DVec3, f64)> {
        match self {
            Self::Sphere { centre, radius } => Some((*centre, *radius)),
            Self::Capsule { ends: [a, b], radius } => Some((0.5 * (*a + *b), 0.5 * (*b - *a).length() + radius)),
            Self::HalfSpace { .. } => None,
        }
    }
}
