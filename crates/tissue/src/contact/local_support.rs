//! Supports in a body's own frame and in single precision, for the sweeps.

use crate::{Body, Support, SupportField, SupportPlane};
use glam::{DVec3, Vec3A};

/// A support in a body's frame.
#[derive(Clone, Debug)]
pub(crate) enum LocalSupport {
    Plane(LocalPlane),
    Field(LocalField),
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalPlane {
    pub point: Vec3A,
    pub normal: Vec3A,
    friction: f32,
}

/// As [`SupportField`].
#[derive(Clone, Debug)]
pub(crate) struct LocalField {
    origin: Vec3A,
    /// Along columns and rows over the cell (1/m), and up.
    axes: [Vec3A; 3],
    columns: usize,
    /// Last middle of three coefficients, by axis.
    last: [f32; 2],
    heights: Vec<f32>,
    friction: f32,
}

impl LocalSupport {
    /// The supports of a body.
    pub fn of(body: &Body) -> Vec<Self> {
        let local = |support: &Support| match support {
            Support::Plane(plane) => Self::Plane(LocalPlane::new(plane, body.origin)),
            Support::Field(field) => Self::Field(LocalField::new(field, body.origin)),
        };
        body.supports.iter().map(local).collect()
    }

    pub fn friction(&self) -> f32 {
        match self {
            Self::Plane(plane) => plane.friction,
            Self::Field(field) => field.friction,
        }
    }

    /// Height of a point above the support (m), and its gradient.
    #[inline]
    pub fn contact(&self, x: Vec3A) -> (f32, Vec3A) {
        match self {
            Self::Plane(plane) => ((x - plane.point).dot(plane.normal), plane.normal),
            Self::Field(field) => field.contact(x),
        }
    }
}

impl LocalPlane {
    fn new(plane: &SupportPlane, origin: DVec3) -> Self {
        Self {
            point: (plane.point - origin).as_vec3a(),
            normal: plane.normal.as_vec3a(),
            friction: plane.friction as f32,
        }
    }
}

impl LocalField {
    fn new(field: &SupportField, origin: DVec3) -> Self {
        let [a, b, up] = field.axes;
        Self {
            origin: (field.origin - origin).as_vec3a(),
            axes: [(a / field.cell).as_vec3a(), (b / field.cell).as_vec3a(), up.as_vec3a()],
            columns: field.size[0],
            last: field.size.map(|n| (n - 2) as f32),
            heights: field.heights.iter().map(|h| *h as f32).collect(),
            friction: field.friction() as f32,
        }
    }

    #[inline]
    fn contact(&self, x: Vec3A) -> (f32, Vec3A) {
        let off = x - self.origin;
        let [a, b, up] = self.axes;
        let (column, across, slope_across) = knot(off.dot(a), self.last[0]);
        let (row, down, slope_down) = knot(off.dot(b), self.last[1]);
        let (mut height, mut along_a, mut along_b) = (0.0, 0.0, 0.0);
        for j in 0..3 {
            let at = (row + j) * self.columns + column;
            let [p, q, r] = [self.heights[at], self.heights[at + 1], self.heights[at + 2]];
            let value = across[0] * p + across[1] * q + across[2] * r;
            height += down[j] * value;
            along_a += down[j] * (slope_across[0] * p + slope_across[1] * q + slope_across[2] * r);
            along_b += slope_down[j] * value;
        }
        (off.dot(up) - height, up - along_a * a - along_b * b)
    }
}

/// First of the three coefficients at a place along an axis, their weights and the weights'
/// derivatives. NaN counts as the first place.
#[inline]
fn knot(place: f32, last: f32) -> (usize, [f32; 3], [f32; 3]) {
    let place = place.clamp(0.5, last + 0.5);
    let middle = place.round().clamp(1.0, last);
    let t = place - middle;
    let weights = [0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)];
    ((middle - 1.0).max(0.0) as usize, weights, [t - 0.5, -2.0 * t, t + 0.5])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BodyDescription, ConstitutiveModel, Material, ModelBuilder};
    use trocar_geometry::TetMesh;

    /// The sweeps' field is the oracle's.
    #[test]
    fn both_precisions_agree() {
        let p = |x: f64, y: f64, z: f64| 1e-2 * DVec3::new(x, y, z);
        let mesh = TetMesh {
            vertices: vec![p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.3), p(0.0, 1.0, 0.4), p(0.3, 0.3, 1.0)],
            tets: vec![[0, 1, 2, 3]],
        };
        let field = SupportField::under(&mesh, DVec3::Z, 1e-3, 0.3).unwrap();
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let supports = vec![field.clone().into()];
        let body = BodyDescription { name: "tet".into(), mesh: &mesh, material, pinned: vec![], supports };
        let mut builder = ModelBuilder::new();
        builder.body(body).unwrap();
        let model = builder.build().unwrap();
        let body = &model.bodies[0];
        let local = &LocalSupport::of(body)[0];
        let mut highest: f64 = 0.0;
        for k in 0..500 {
            let at = |f: f64| (f64::from(k) * f).fract();
            let x = 0.02 * DVec3::new(at(0.617), at(0.137), at(0.711)) - DVec3::splat(5e-3);
            let exact = field.contact(x);
            let (height, gradient) = local.contact((x - body.origin).as_vec3a());
            highest = highest.max((exact.gradient - DVec3::Z).length());
            assert!((f64::from(height) - exact.height).abs() < 1e-8, "{x}: {height} m, {} m", exact.height);
            assert!((gradient.as_dvec3() - exact.gradient).length() < 1e-4, "{x}");
        }
        assert!(highest > 0.3);
    }
}
