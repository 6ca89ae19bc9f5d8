//! Convex shapes and their exact signed distance.

use super::hull::Hull;
use super::nearest::{MAX_SHAPE_SIZE, Nearest};
use super::shape_surface;
use glam::{DQuat, DVec3};
use trocar_geometry::TriMesh;

/// Below this length (m) an offset has no direction: its square would underflow.
const NO_DIRECTION: f64 = 1e-150;

/// A convex shape in the frame of its carrier.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All points within `radius` of a point.
    Sphere {
        /// Centre (m).
        centre: DVec3,
        /// (m)
        radius: f64,
    },
    /// All points within `radius` of a segment.
    Capsule {
        /// Ends of the segment (m); they may coincide.
        ends: [DVec3; 2],
        /// (m)
        radius: f64,
    },
    /// Everything behind a plane.
    HalfSpace {
        /// A point of the plane (m).
        point: DVec3,
        /// Unit normal, outwards.
        normal: DVec3,
    },
    /// A cuboid.
    Box {
        /// Centre (m).
        centre: DVec3,
        /// From the cuboid's axes to the frame.
        rotation: DQuat,
        /// Half its edges' lengths (m).
        half: DVec3,
    },
    /// A convex polyhedron.
    Hull(Hull),
}

impl Shape {
    /// The nearest point of the surface to `p` (m), in the shape's frame: in closed form, exact but
    /// for rounding.
    pub fn nearest(&self, p: DVec3) -> Nearest {
        match self {
            Self::Sphere { centre, radius } => round(p - *centre, *radius, DVec3::Z),
            Self::Capsule { ends: [a, b], radius } => {
                let along = *b - *a;
                let share = ((p - *a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                let aside = along.try_normalize().map_or(DVec3::Z, |axis| axis.any_orthonormal_vector());
                round(p - *a - share * along, *radius, aside)
            }
            Self::HalfSpace { point, normal } => Nearest { distance: (p - *point).dot(*normal), normal: *normal },
            Self::Box { centre, rotation, half } => {
                let near = nearest_of_cuboid(rotation.inverse() * (p - *centre), *half);
                Nearest { normal: *rotation * near.normal, ..near }
            }
            Self::Hull(hull) => hull.nearest(p),
        }
    }

    /// Smallest and largest coordinates (m); infinite for a half-space.
    pub fn aabb(&self) -> (DVec3, DVec3) {
        match self {
            Self::Sphere { centre, radius } => (*centre - *radius, *centre + *radius),
            Self::Capsule { ends: [a, b], radius } => (a.min(*b) - *radius, a.max(*b) + *radius),
            Self::HalfSpace { .. } => (DVec3::NEG_INFINITY, DVec3::INFINITY),
            Self::Box { centre, rotation, half } => {
                let reach = (*rotation * (half.x * DVec3::X)).abs()
                    + (*rotation * (half.y * DVec3::Y)).abs()
                    + (*rotation * (half.z * DVec3::Z)).abs();
                (*centre - reach, *centre + reach)
            }
            Self::Hull(hull) => hull.aabb(),
        }
    }

    /// Centre and radius (m) of a ball that contains every point within `margin` of the shape; the
    /// radius is infinite for a half-space. The ball moves with the tool and keeps its radius.
    pub fn bounds(&self, margin: f64) -> (DVec3, f64) {
        let (centre, radius) = match self {
            Self::Sphere { centre, radius } => (*centre, *radius),
            Self::Capsule { ends: [a, b], radius } => (0.5 * (*a + *b), 0.5 * (*b - *a).length() + radius),
            Self::HalfSpace { point, .. } => (*point, f64::INFINITY),
            Self::Box { centre, half, .. } => (*centre, half.length()),
            Self::Hull(hull) => hull.ball(),
        };
        (centre, radius + margin)
    }

    /// The surface for pictures: closed, facing outwards; round shapes to within 1% of their
    /// radius. Empty for a half-space.
    pub fn surface(&self) -> TriMesh {
        match self {
            Self::Sphere { centre, radius } => shape_surface::capsule([*centre; 2], *radius),
            Self::Capsule { ends, radius } => shape_surface::capsule(*ends, *radius),
            Self::HalfSpace { .. } => TriMesh::default(),
            Self::Box { centre, rotation, half } => shape_surface::cuboid(*centre, *rotation, *half),
            Self::Hull(hull) => hull.surface().clone(),
        }
    }

    /// Checks the shape. A [`Hull`] is checked when it is made.
    ///
    /// # Errors
    /// Numbers that are not finite, sizes that are not above 0 or exceed 10 m, coordinates beyond
    /// 10 m, normals and rotations that are not of unit length.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Sphere { centre, radius } => {
                check_point("a sphere's centre", *centre)?;
                check_size("a sphere's radius", *radius)
            }
            Self::Capsule { ends, radius } => {
                check_point("a capsule's first end", ends[0])?;
                check_point("a capsule's second end", ends[1])?;
                check_size("a capsule's radius", *radius)
            }
            Self::HalfSpace { point, normal } => {
                check_point("a half-space's point", *point)?;
                if normal.is_normalized() {
                    Ok(())
                } else {
                    Err(format!("a half-space's normal is {normal}, of length {}; it has length 1", normal.length()))
                }
            }
            Self::Box { centre, rotation, half } => {
                check_point("a box's centre", *centre)?;
                for half in half.to_array() {
                    check_size("half an edge of a box", half)?;
                }
                if rotation.is_normalized() {
                    Ok(())
                } else {
                    Err(format!("a box's rotation is {rotation}, of length {}; it has length 1", rotation.length()))
                }
            }
            Self::Hull(_) => Ok(()),
        }
    }
}

impl From<Hull> for Shape {
    fn from(hull: Hull) -> Self {
        Self::Hull(hull)
    }
}

/// The nearest point of a ball at the offset `off` from its centre; `otherwise` is the normal where
/// there is no direction.
fn round(off: DVec3, radius: f64, otherwise: DVec3) -> Nearest {
    let length = off.length();
    let normal = if length > NO_DIRECTION { off / length } else { otherwise };
    Nearest { distance: length - radius, normal }
}

/// The nearest point of a cuboid about the origin, along the axes.
fn nearest_of_cuboid(p: DVec3, half: DVec3) -> Nearest {
    let side = DVec3::ONE.copysign(p);
    let beyond = p.abs() - half;
    let off = beyond.max(DVec3::ZERO);
    let length = off.length();
    if length > NO_DIRECTION {
        return Nearest { distance: length, normal: side * off / length };
    }
    let axis = if beyond.x >= beyond.y && beyond.x >= beyond.z {
        DVec3::X
    } else if beyond.y >= beyond.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    Nearest { distance: beyond.max_element(), normal: side * axis }
}

fn check_point(name: &str, p: DVec3) -> Result<(), String> {
    // NaN fails every comparison.
    if p.abs().max_element() <= MAX_SHAPE_SIZE && p.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} is {p} m; coordinates must be finite and within {MAX_SHAPE_SIZE} m"))
    }
}

fn check_size(name: &str, size: f64) -> Result<(), String> {
    if size > 0.0 && size <= MAX_SHAPE_SIZE {
        Ok(())
    } else {
        Err(format!("{name} is {size} m; must be in (0, {MAX_SHAPE_SIZE}]"))
    }
}
