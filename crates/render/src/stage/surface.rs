//! Points on the surfaces of bodies: where rays meet them, one at a time or eight.

use super::model::{Shape, Stage, StageHit};
use super::vertex::vector;
use crate::lanes::{LANES, Vec8, cross, dot, gathered, minus, splat};
use crate::raster::View;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8};
use glam::{Mat3A, Vec3A};

/// One attribute of the vertices at eight places, for each of three corners.
macro_rules! gather {
    ($simd:expr, $vertices:expr, $corners:expr, $attribute:ident) => {{
        let (of, [p, q, r]) = ($vertices, &$corners);
        [
            gather!(@one $simd, of, p, $attribute),
            gather!(@one $simd, of, q, $attribute),
            gather!(@one $simd, of, r, $attribute),
        ]
    }};
    (@one $simd:expr, $of:expr, $at:expr, $attribute:ident) => {
        gathered(
            $simd,
            [
                &$of[$at[0]].$attribute,
                &$of[$at[1]].$attribute,
                &$of[$at[2]].$attribute,
                &$of[$at[3]].$attribute,
                &$of[$at[4]].$attribute,
                &$of[$at[5]].$attribute,
                &$of[$at[6]].$attribute,
                &$of[$at[7]].$attribute,
            ],
        )
    };
}

/// A surface point, in the world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub position: Vec3A,
    /// Unit normal of the triangle, towards the origin of the ray.
    pub flat: Vec3A,
    /// Interpolated unit normal, on the same side.
    pub smooth: Vec3A,
    /// Linear colour.
    pub albedo: Vec3A,
}

/// Eight surface points, in the world frame; see [`Surface`].
pub(crate) struct Surfaces<S: Simd> {
    pub position: Vec8<S>,
    pub flat: Vec8<S>,
    pub smooth: Vec8<S>,
    pub albedo: Vec8<S>,
    /// Unit directions towards the eye.
    pub to_eye: Vec8<S>,
}

impl Stage {
    /// The surface point that a ray in `direction` hit.
    #[inline]
    pub(crate) fn surface(&self, hit: &StageHit, direction: Vec3A) -> Surface {
        let body = &self.bodies[hit.body as usize];
        let shape = &self.shapes[body.shape];
        let [a, b, c] = shape.corners(hit.triangle).map(|corner| &shape.vertices[corner]);
        let [u, v] = [hit.u, hit.v];
        let mixed = |a: &[f32; 4], b: &[f32; 4], c: &[f32; 4]| {
            let (a, b, c) = (vector(a), vector(b), vector(c));
            a + u * (b - a) + v * (c - a)
        };
        let mut position = mixed(&a.position, &b.position, &c.position);
        let corner = vector(&a.position);
        let mut flat = (vector(&b.position) - corner).cross(vector(&c.position) - corner);
        let mut smooth = mixed(&a.normal, &b.normal, &c.normal);
        if !body.is_identity {
            position = body.rotation * position + body.translation;
            flat = body.rotation * flat;
            smooth = body.rotation * smooth;
        }
        flat = flat.normalize_or_zero();
        if flat.dot(direction) > 0.0 {
            flat = -flat;
        }
        if smooth.dot(flat) < 0.0 {
            smooth = -smooth;
        }
        // An interpolated normal can face away from the eye; the triangle's normal replaces it.
        let smooth = smooth.try_normalize().filter(|n| n.dot(direction) < 0.0).unwrap_or(flat);
        let albedo = if shape.is_colored { mixed(&a.color, &b.color, &c.color) } else { body.color };
        Surface { position, flat, smooth, albedo }
    }

    /// The surface points of a body that eight rays of a camera meet at parameters `t`, in the
    /// lanes `group`: on triangles with these numbers among those of all bodies.
    #[allow(clippy::too_many_arguments, reason = "one call")]
    #[inline(always)]
    pub(crate) fn surfaces<S: Simd>(
        &self,
        simd: S,
        body: usize,
        numbers: &[u32],
        group: u64,
        view: &View<'_>,
        ray: &Vec8<S>,
        t: f32x8<S>,
    ) -> Surfaces<S> {
        let body = &self.bodies[body];
        let shape = &self.shapes[body.shape];
        let corners = corners(shape, body.first_triangle, numbers, group);
        let held = &shape.vertices[..];
        let direction = turned(&view.rotation, ray);
        // In the shape's frame.
        let eye = all(simd, body.inverse_rotation * (view.origin - body.translation));
        let along = turned(&(body.inverse_rotation * view.rotation), ray);
        let [a, b, c] = gather!(simd, held, corners, position);
        let (x, y) = (minus(b, a), minus(c, a));
        let p = minus(eye, a);
        let p = [p[0] + along[0] * t, p[1] + along[1] * t, p[2] + along[2] * t];
        let normal = cross(x, y);
        let share = splat(simd, 1.0) / dot(normal, normal).max(splat(simd, f32::MIN_POSITIVE));
        let (u, v) = (dot(cross(p, y), normal) * share, dot(cross(x, p), normal) * share);
        let smooth = mixed(gather!(simd, held, corners, normal), u, v);
        let albedo =
            if shape.is_colored { mixed(gather!(simd, held, corners, color), u, v) } else { all(simd, body.color) };

        let (flat, smooth) = (turned(&body.rotation, &normal), turned(&body.rotation, &smooth));
        let to_eye = unit(simd, minus([splat(simd, 0.0); 3], direction));
        let flat = towards(simd, unit(simd, flat), &to_eye);
        let smooth = unit(simd, towards(simd, smooth, &flat));
        // An interpolated normal can face away from the eye; the triangle's normal replaces it.
        let ahead = dot(smooth, to_eye).simd_gt(splat(simd, 0.0));
        let smooth =
            [ahead.select(smooth[0], flat[0]), ahead.select(smooth[1], flat[1]), ahead.select(smooth[2], flat[2])];
        let origin = all(simd, view.origin);
        let position = [origin[0] + direction[0] * t, origin[1] + direction[1] * t, origin[2] + direction[2] * t];
        Surfaces { position, flat, smooth, albedo, to_eye }
    }
}

/// Corners of the triangles in the lanes `group`, by corner; other lanes repeat one of them.
#[inline(always)]
fn corners(shape: &Shape, first: u32, numbers: &[u32], group: u64) -> [[usize; LANES]; 3] {
    let any = shape.corners(numbers[group.trailing_zeros() as usize & (LANES - 1)] - first);
    let mut corners = [[any[0]; LANES], [any[1]; LANES], [any[2]; LANES]];
    for lane in 0..LANES {
        if group >> lane & 1 == 1 {
            let [a, b, c] = shape.corners(numbers[lane] - first);
            (corners[0][lane], corners[1][lane], corners[2][lane]) = (a, b, c);
        }
    }
    corners
}

/// An attribute at barycentric coordinates of the second and third corner.
#[inline(always)]
fn mixed<S: Simd>([a, b, c]: [Vec8<S>; 3], u: f32x8<S>, v: f32x8<S>) -> Vec8<S> {
    let (x, y) = (minus(b, a), minus(c, a));
    [a[0] + x[0] * u + y[0] * v, a[1] + x[1] * u + y[1] * v, a[2] + x[2] * u + y[2] * v]
}

/// The rotated vectors.
#[inline(always)]
pub(crate) fn turned<S: Simd>(rotation: &Mat3A, v: &Vec8<S>) -> Vec8<S> {
    let (a, b, c) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let [x, y, z] = *v;
    [(x * a.x + y * b.x) + z * c.x, (x * a.y + y * b.y) + z * c.y, (x * a.z + y * b.z) + z * c.z]
}

/// The vector on the side of `there`.
#[inline(always)]
fn towards<S: Simd>(simd: S, v: Vec8<S>, there: &Vec8<S>) -> Vec8<S> {
    let zero = splat(simd, 0.0);
    let away = dot(v, *there).simd_lt(zero);
    [away.select(zero - v[0], v[0]), away.select(zero - v[1], v[1]), away.select(zero - v[2], v[2])]
}

#[inline(always)]
fn unit<S: Simd>(simd: S, v: Vec8<S>) -> Vec8<S> {
    let share = splat(simd, 1.0) / dot(v, v).sqrt().max(splat(simd, 1e-20));
    [v[0] * share, v[1] * share, v[2] * share]
}

#[inline(always)]
fn all<S: Simd>(simd: S, v: Vec3A) -> Vec8<S> {
    [splat(simd, v.x), splat(simd, v.y), splat(simd, v.z)]
}
