//! From points to pixels: where a triangle may be in the picture, for any lens.
//!
//! Whether a pixel shows a triangle is decided with the pixel's own ray. The projection only says
//! which pixels to ask, so it may be approximate.

use super::RayGenerator;
use crate::lanes::{LANES, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8};
use glam::Vec3A;
use trocar_camera::{CameraModel, Distortion, Fisheye};

/// Least depth of a point that a pinhole camera projects (m).
const NEAR: f32 = 1e-4;

/// Distance between image points from which the curvature of straight lines is measured (px).
const CHORD: usize = 8;

/// A lens in single precision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projection {
    lens: Lens,
    focal: [f32; 2],
    centre: [f32; 2],
    /// Beyond this squared distance from the axis (of the image plane at z = 1), or beyond this
    /// angle of a fisheye (rad), points are not projected: a polynomial may fold back there.
    limit: f32,
    /// Error of an image point (px).
    pub margin: f32,
    /// Greatest distance between the image of a straight line and the chord of its ends, per
    /// squared length of the chord (1/px).
    pub bend: f32,
}

#[derive(Clone, Debug, Default)]
enum Lens {
    #[default]
    Straight,
    Rational([f32; 8]),
    Fisheye([f32; 4]),
}

impl Projection {
    pub fn new(model: &CameraModel, rays: &RayGenerator) -> Self {
        let camera = model.camera();
        let (lens, limit) = match model {
            CameraModel::Pinhole(c) if c.distortion.is_none() => (Lens::Straight, f32::INFINITY),
            CameraModel::Pinhole(c) => {
                (Lens::Rational(c.distortion.0.map(|k| k as f32)), rational_limit(&c.distortion, rays))
            }
            CameraModel::Fisheye(_, lens) => (Lens::Fisheye(lens.0.map(|k| k as f32)), fisheye_limit(lens, rays)),
        };
        let bend = if matches!(lens, Lens::Straight) { 0.0 } else { bend(rays) };
        let focal = [camera.fx as f32, camera.fy as f32];
        Self {
            lens,
            focal,
            centre: [camera.cx as f32, camera.cy as f32],
            limit,
            // Rounding, and the error of the arc tangent below.
            margin: 0.01 + 1e-5 * focal[0].abs().max(focal[1].abs()),
            bend,
        }
    }

    /// Whether the rays have z = 1: their parameters are depths.
    pub fn is_flat(&self) -> bool {
        !matches!(self.lens, Lens::Fisheye(_))
    }

    /// Image points of eight points in the camera frame; NaN where they are not known.
    #[inline(always)]
    pub fn project<S: Simd>(&self, simd: S, [x, y, z]: [f32x8<S>; 3]) -> [f32x8<S>; 2] {
        let nan = splat(simd, f32::NAN);
        let [fx, fy] = self.focal;
        let [cx, cy] = self.centre;
        let (a, b, known) = match &self.lens {
            Lens::Straight => {
                let share = splat(simd, 1.0) / z;
                (x * share, y * share, z.simd_gt(splat(simd, NEAR)))
            }
            Lens::Rational([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let share = splat(simd, 1.0) / z;
                let (x, y) = (x * share, y * share);
                let r2 = x * x + y * y;
                let over = r2 * (r2 * (r2 * *k3 + *k2) + *k1) + 1.0;
                let under = r2 * (r2 * (r2 * *k6 + *k5) + *k4) + 1.0;
                let radial = over / under;
                let xy = x * y * 2.0;
                let a = x * radial + xy * *p1 + (r2 + x * x * 2.0) * *p2;
                let b = y * radial + (r2 + y * y * 2.0) * *p1 + xy * *p2;
                (a, b, z.simd_gt(splat(simd, NEAR)) & r2.simd_le(splat(simd, self.limit)))
            }
            Lens::Fisheye([k1, k2, k3, k4]) => {
                let r = (x * x + y * y).sqrt();
                let angle = angle(simd, r, z);
                let t2 = angle * angle;
                let bent = angle * (t2 * (t2 * (t2 * (t2 * *k4 + *k3) + *k2) + *k1) + 1.0);
                let share = bent / r.max(splat(simd, 1e-20));
                (x * share, y * share, angle.simd_le(splat(simd, self.limit)))
            }
        };
        [known.select(a * fx + cx, nan), known.select(b * fy + cy, nan)]
    }
}

/// Angle between the axis and points at `z` along and `r` beside it (rad), with an error of 1e-5.
#[allow(clippy::excessive_precision, reason = "the digits of the source")]
#[inline(always)]
fn angle<S: Simd>(simd: S, r: f32x8<S>, z: f32x8<S>) -> f32x8<S> {
    let along = z.abs();
    let steep = r.simd_gt(along);
    let low = steep.select(along, r);
    let high = steep.select(r, along);
    let a = low / high;
    let s = a * a;
    // Odd minimax polynomial on [0, 1] (Abramowitz and Stegun 4.4.49).
    let fine = s * (s * (s * 0.002_866_225_7 - 0.016_165_736_7) + 0.042_909_613_8);
    let rough = s * (s * (s * (s * (fine - 0.075_289_64) + 0.106_562_639_3) - 0.142_088_994_4) + 0.199_935_508_5);
    let arc = a * (s * (rough - 0.333_331_452_8) + 1.0);
    let arc = steep.select(splat(simd, std::f32::consts::FRAC_PI_2) - arc, arc);
    z.simd_lt(splat(simd, 0.0)).select(splat(simd, std::f32::consts::PI) - arc, arc)
}

/// Directions of all visible pixels.
fn visible(rays: &RayGenerator) -> impl Iterator<Item = Vec3A> + '_ {
    (0..rays.width() * rays.height()).filter_map(|pixel| rays.centre(pixel))
}

/// Slightly beyond the largest squared distance of a visible ray from the axis, as far as the
/// distortion grows.
fn rational_limit(distortion: &Distortion, rays: &RayGenerator) -> f32 {
    let greatest = visible(rays).map(|d| d.x * d.x + d.y * d.y).fold(0.0, f32::max);
    // Looks along eight directions whether image points move outward.
    let grows = |beyond: f64| {
        (0..8).all(|k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(k)).sin_cos();
            let outward = glam::DVec2::new(cos, sin);
            let radius = f64::from(greatest).sqrt();
            let at = |share: f64| distortion.apply(radius * share * outward).dot(outward);
            (0..32).map(|i| f64::from(i) / 32.0).all(|s| at(1.0 + beyond * (s + 1.0 / 32.0)) > at(1.0 + beyond * s))
        })
    };
    let beyond = [0.2, 0.1, 0.05, 0.02].into_iter().find(|b| grows(*b)).unwrap_or(0.0) as f32;
    greatest * (1.0 + beyond) * (1.0 + beyond)
}

/// Slightly beyond the largest angle of a visible ray (rad), as far as the image grows.
fn fisheye_limit(lens: &Fisheye, rays: &RayGenerator) -> f32 {
    let greatest = visible(rays).map(|d| d.truncate().length().atan2(d.z)).fold(0.0, f32::max);
    let grows = |beyond: f64| {
        let at = |share: f64| lens.apply(f64::from(greatest) * share);
        (0..32).map(|i| f64::from(i) / 32.0).all(|s| at(1.0 + beyond * (s + 1.0 / 32.0)) > at(1.0 + beyond * s))
    };
    let beyond = [0.2, 0.1, 0.05, 0.02].into_iter().find(|b| grows(*b)).unwrap_or(0.0) as f32;
    (greatest * (1.0 + beyond)).min(3.1)
}

/// See [`Projection::bend`]: measured on chords all over the picture, and doubled.
fn bend(rays: &RayGenerator) -> f32 {
    let chord = CHORD.min(rays.width().min(rays.height()).saturating_sub(1)) & !1;
    if chord == 0 {
        return 0.1;
    }
    let mut greatest = 0.0_f32;
    for v in (0..rays.height()).step_by(LANES / 2) {
        for u in (0..rays.width()).step_by(LANES / 2) {
            for (du, dv) in [(chord, 0), (0, chord), (chord, chord)] {
                let (end_u, end_v) = (u + du, v + dv);
                if end_u >= rays.width() || end_v >= rays.height() {
                    continue;
                }
                let first = rays.through(u, v).normalize();
                let last = rays.through(end_u, end_v).normalize();
                let middle = rays.through(u + du / 2, v + dv / 2).normalize();
                let aside = middle.dot(first.cross(last).normalize_or_zero()).abs();
                let pixels = ((du * du + dv * dv) as f32).sqrt();
                let pixel = (last - first).length() / pixels;
                let here = aside / pixel / (pixels * pixels);
                if here.is_finite() {
                    greatest = greatest.max(here);
                }
            }
        }
    }
    2.0 * greatest
}
