//! Convex shapes and their exact signed distance.

use glam::DVec3;

/// A convex shape in the frame of what carries it.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All points within `radius` of a point.
    Sphere {
        /// Centre [m].
        centre: DVec3,
        /// [m]
        radius: f64,
    },
    /// All points within `radius` of a segment.
    Capsule {
        /// Ends of the segment [m].
        ends: [DVec3; 2],
        /// [m]
        radius: f64,
    },
    /// Everything behind a plane.
    HalfSpace {
        /// A point of the plane [m].
        point: DVec3,
        /// Unit normal, outwards.
        normal: DVec3,
    },
}

/// The point of a shape's surface nearest to some point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance [m]: negative inside.
    pub distance: f64,
    /// Unit normal there, outwards: the gradient of the distance.
    pub normal: DVec3,
}

impl Shape {
    /// The nearest point of the surface to `p`, in the shape's frame.
    pub fn nearest(&self, p: DVec3) -> Nearest {
        let round = |off: DVec3, radius: f64| {
            let length = off.length();
            let normal = if length > 0.0 { off / length } else { DVec3::Z };
            Nearest { distance: length - radius, normal }
        };
        match self {
            Self::Sphere { centre, radius } => round(p - *centre, *radius),
            Self::Capsule { ends: [a, b], radius } => {
                let along = *b - *a;
                let share = ((p - *a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                round(p - *a - share * along, *radius)
            }
            Self::HalfSpace { point, normal } => Nearest { distance: (p - *point).dot(*normal), normal: *normal },
        }
    }
}
