//! Closes one organ: from its mask in the composite to its closed surface.

use crate::binary_grid::binary_grid;
use crate::check::{DepthCheck, check};
use crate::closed_surface::closed_surface;
use crate::colour::color_vertices;
use crate::composite::Composite;
use crate::front::front;
use crate::outline::tidy;
use crate::resample::{self, resample};
use crate::thickness::thickness;
use crate::{BackRule, Error, Result, SurfaceRule};
use glam::{DVec2, DVec3};
use trocar_camera::{Camera, Mask};
use trocar_geometry::TriMesh;
use trocar_recording::OrganInfo;

/// The common input of a recording's organs.
pub struct View<'a> {
    /// The scene without instruments.
    pub background: &'a Composite,
    /// The camera of the composite.
    pub camera: Camera,
    /// Unit of the recording's depth (m).
    pub depth_scale: f64,
    /// The rule for the thickness of organs.
    pub back: BackRule,
    /// The rule for surfaces.
    pub surface: SurfaceRule,
}

/// An organ before it is filled with tetrahedra.
pub struct Closed {
    /// Closed, outward, coloured surface in the camera frame (m).
    pub surface: TriMesh,
    /// The cleaned mask.
    pub mask: Mask,
    /// A point near the organ's base (m).
    pub base: DVec3,
    /// The surface compared with the measured depth.
    pub check: DepthCheck,
}

/// Closes the organ inside `mask`. Adds notes for the user to `notes`.
pub fn close(info: &OrganInfo, mut mask: Mask, view: &View<'_>, notes: &mut Vec<String>) -> Result<Closed> {
    let View { background, ref camera, depth_scale, back: back_rule, surface: rule } = *view;
    let name = &info.name;
    let tidied = tidy(&mut mask);
    let pixels = mask.count();
    let mut note = |what: String| notes.push(format!("{name}: {what}."));
    if tidied.dropped > 0 {
        note(format!("{} mask pixels outside its largest piece were dropped", tidied.dropped));
    }
    if tidied.filled > 0 {
        note(format!("{} pixels of small holes in its mask were filled", tidied.filled));
    }
    if tidied.on_border > 0 {
        note(format!("it reaches the image's border and was closed there ({} pixels)", tidied.on_border));
    }

    let unmeasured = || Error::Organ {
        organ: name.clone(),
        reason: format!("no depth was measured inside its mask ({pixels} pixels); is the mask on the organ?"),
    };
    let inside = background.depth.depth.iter().zip(&mask.set).filter(|(z, set)| **set && **z > 0.0);
    let mut measured: Vec<f64> = inside.map(|(z, _)| f64::from(*z)).collect();
    measured.sort_by(f64::total_cmp);
    let middle = *measured.get(measured.len() / 2).ok_or_else(unmeasured)?;
    // Noise of the composite: the recording's unit, or the window's range.
    let noise = depth_scale.max(0.5 * background.depth_range_median);
    // A first radius, from the mask at one depth, separates edges from outliers.
    let flat = thickness(&vec![middle; mask.set.len()], &mask, camera, BackRule::Rounded).radius;
    let front = front(&background.depth, &mask, camera, flat, noise).ok_or_else(unmeasured)?;
    if front.outliers > 0 {
        note(format!("{} depths that are not the organ's were dropped", front.outliers));
    }
    if 10 * front.filled > pixels {
        let share = 100.0 * front.filled as f64 / pixels as f64;
        note(format!("{share:.0}% of its pixels had no depth and were filled in"));
    }

    let back = thickness(&front.depth, &mask, camera, back_rule);
    if back_rule == BackRule::Fitted {
        note(format!("its profile is taken {:.2} times as high as it is wide", back.height_ratio));
    }
    let raw = closed_surface(&front.depth, &back.h, &mask, camera);
    check_size(name, &raw)?;
    let mut surface = match (rule, raw.bounds()) {
        (SurfaceRule::BinaryGrid, Some(bounds)) => {
            resample::tidy(name, &binary_grid(&front.depth, &back.h, &mask, camera, bounds))?
        }
        _ => resample(name, &raw, back.radius * back.height_ratio.min(1.0))?,
    };
    color_vertices(&mut surface, &background.color, &background.colored, &mask, camera);
    let check = check(&surface, &background.depth, &mask, camera).ok_or_else(unmeasured)?;
    let base = base(info.base_px, &mask, &front.depth, camera, middle);
    Ok(Closed { surface, mask, base, check })
}

/// Refuses a surface that is too large or too small for an organ, which is usually a wrong unit.
fn check_size(name: &str, surface: &TriMesh) -> Result<()> {
    let extent = surface.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
    if (2e-3..=1.0).contains(&extent) {
        return Ok(());
    }
    let reason = format!(
        "it would be {:.1} mm long, but organs are in [2 mm, 1 m]; check depth_scale_m, camera.fx and camera.fy",
        1e3 * extent
    );
    Err(Error::Organ { organ: name.to_owned(), reason })
}

/// The organ's point at `base_px`, or at the mask's pixel nearest to it; by default the point at
/// the image's centre and the organ's depth `middle` (m).
fn base(base_px: Option<[f64; 2]>, mask: &Mask, front: &[f64], camera: &Camera, middle: f64) -> DVec3 {
    let pixel = |i: usize| DVec2::new((i % mask.width) as f64, (i / mask.width) as f64);
    let Some(at) = base_px.map(DVec2::from) else {
        return camera.ray(0.5 * (mask.width as f64 - 1.0), 0.5 * (mask.height as f64 - 1.0)) * middle;
    };
    let nearest = (0..front.len())
        .filter(|i| mask.set[*i])
        .min_by(|a, b| pixel(*a).distance_squared(at).total_cmp(&pixel(*b).distance_squared(at)));
    match nearest {
        Some(i) => camera.ray(pixel(i).x, pixel(i).y) * front[i],
        None => camera.ray(at.x, at.y) * middle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composite::CompositeTimes;
    use trocar_camera::{ColorImage, DepthImage};

    /// An ellipsoid with half axes `a` (m) and centre `c` (m), seen by the D405 at 1 mm
    /// quantisation.
    fn closed(c: DVec3, a: DVec3) -> Closed {
        let camera = Camera::d405();
        let (w, h) = (camera.width, camera.height);
        let (mut depth, mut mask) = (DepthImage::new(w, h), Mask::new(w, h));
        for i in 0..w * h {
            let ray = camera.ray((i % w) as f64, (i / w) as f64) / a;
            let (p, q) = (ray.length_squared(), ray.dot(c / a));
            let root = q * q - p * ((c / a).length_squared() - 1.0);
            depth.depth[i] = if root > 0.0 { ((q - root.sqrt()) / p) as f32 } else { c.z as f32 };
            depth.depth[i] = (1e3 * depth.depth[i]).round() / 1e3;
            mask.set[i] = root > 0.0;
        }
        let mut colored = Mask::new(w, h);
        colored.set.fill(true);
        let background = Composite {
            input: ColorImage::new(w, h, [0; 3]),
            instruments: Mask::new(w, h),
            color: ColorImage::new(w, h, [170, 60, 50]),
            colored,
            depth,
            frames_used: 1,
            recovered_share: 0.0,
            coverage: 1.0,
            depth_range_median: 0.0,
            moving: Mask::new(w, h),
            hash: 0,
            times: CompositeTimes::default(),
        };
        let info = OrganInfo { name: "organ".into(), ..OrganInfo::default() };
        let surface = SurfaceRule::SignedDistance;
        let view = View { background: &background, camera, depth_scale: 1e-3, back: BackRule::Rounded, surface };
        close(&info, mask, &view, &mut Vec::new()).unwrap()
    }

    #[test]
    fn depth_error_is_below_the_quantisation_for_small_and_large_organs() {
        let cases = [
            ("appendix", DVec3::new(0.03, 0.02, 0.28), DVec3::new(0.03, 0.004, 0.004)),
            ("stomach", DVec3::new(-0.02, 0.01, 0.27), DVec3::new(0.03, 0.015, 0.015)),
            ("liver", DVec3::new(0.0, 0.0, 0.42), DVec3::new(0.12, 0.08, 0.08)),
        ];
        for (name, c, a) in cases {
            let Closed { surface, check, .. } = closed(c, a);
            let ratio = surface.volume() / (4.0 / 3.0 * std::f64::consts::PI * a.x * a.y * a.z);
            assert!(surface.is_watertight());
            assert!(check.median_absolute < 0.5e-3 && check.median_signed.abs() < 0.15e-3, "{name}");
            assert!(check.covered > 0.95, "{name}");
            assert!((0.8..1.1).contains(&ratio), "{name}: {ratio}");
        }
    }
}
