//! A ray prepared for traversal.

use glam::Vec3A;

/// A ray prepared for traversal. Its direction need not be of unit length; distances are in units
/// of the direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub origin: Vec3A,
    pub direction: Vec3A,
    pub(super) inverse: [f32; 3],
    /// Index of the bound (of six) that the ray meets first on each axis, and last.
    pub(super) near: [usize; 3],
    pub(super) far: [usize; 3],
    /// The dominant axis of the direction, last, after the other two.
    pub(super) axes: [usize; 3],
    /// The shear that aligns the dominant axis with the ray.
    pub(super) shear: [f32; 3],
}

impl Ray {
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        let d = direction.to_array();
        let inverse = d.map(|c| 1.0 / if c.abs() < 1e-30 { 1e-30_f32.copysign(c) } else { c });
        let near = [0, 1, 2].map(|k| if inverse[k] < 0.0 { k + 3 } else { k });
        let far = [0, 1, 2].map(|k| if inverse[k] < 0.0 { k } else { k + 3 });
        let z = (0..3).fold(0, |best, k| if d[k].abs() > d[best].abs() { k } else { best });
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let shear = [d[x] * inverse[z], d[y] * inverse[z], inverse[z]];
        Self { origin, direction, inverse, near, far, axes: [x, y, z], shear }
    }
}
