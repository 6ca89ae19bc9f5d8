//! Checks of cameras.

use super::{Checked, join, names, number, numbers, point, problem, quaternion};
use crate::{CellCamera, Lens, Scene, View};
use glam::DVec3;

/// Largest side of an image (px).
const MAX_PIXELS: f64 = 8192.0;

pub(super) fn check(scene: &Scene) -> Checked {
    names("camera", scene.cameras.iter().map(|c| c.name.as_str()))?;
    for (i, camera) in scene.cameras.iter().enumerate() {
        one(&format!("camera[{i}]"), camera)?;
    }
    Ok(())
}

fn one(at: &str, camera: &CellCamera) -> Checked {
    for (key, size) in [("size_px", camera.size_px), ("policy_size_px", camera.policy_size_px)] {
        for (k, pixels) in size.iter().enumerate() {
            number(&format!("{at}.{key}[{k}]"), f64::from(*pixels), &(1.0..=MAX_PIXELS))?;
        }
    }
    number(&join(at, "oblique_deg"), camera.oblique_deg, &(-120.0..=120.0))?;
    view(&join(at, "view"), &camera.view)?;
    lens(&join(at, "lens"), &camera.lens)
}

fn view(at: &str, view: &View) -> Checked {
    match *view {
        View::Recording {} => Ok(()),
        View::Pose { position_m, rotation_wxyz } => {
            point(&join(at, "position_m"), position_m)?;
            quaternion(&join(at, "rotation_wxyz"), rotation_wxyz)
        }
        View::LookAt { eye_m, target_m, up } => {
            point(&join(at, "eye_m"), eye_m)?;
            point(&join(at, "target_m"), target_m)?;
            let ahead = DVec3::from(target_m) - DVec3::from(eye_m);
            if ahead.length() < 1e-6 {
                return Err(problem(join(at, "target_m"), " is equal to eye_m; it must be another point".into()));
            }
            let up = DVec3::from(up).try_normalize();
            if up.is_none_or(|up| up.cross(ahead.normalize()).length() < 1e-3) {
                let reason = " is zero or parallel to the view; it must be the direction of the image's top".into();
                return Err(problem(join(at, "up"), reason));
            }
            Ok(())
        }
    }
}

fn lens(at: &str, lens: &Lens) -> Checked {
    match lens {
        Lens::Recording {} => Ok(()),
        Lens::FieldOfView { width_deg, height_deg } => {
            numbers(at, &[("width_deg", *width_deg, 5.0..=170.0), ("height_deg", *height_deg, 5.0..=170.0)])
        }
        Lens::Opencv { fx_px, fy_px, cx_px, cy_px, distortion } => {
            numbers(
                at,
                &[
                    ("fx_px", *fx_px, 1.0..=1e6),
                    ("fy_px", *fy_px, 1.0..=1e6),
                    ("cx_px", *cx_px, -1e5..=1e5),
                    ("cy_px", *cy_px, -1e5..=1e5),
                ],
            )?;
            if !matches!(distortion.len(), 0 | 4 | 5 | 8) {
                let reason = format!(
                    " has {} coefficients; it must have 4, 5 or 8: k1 k2 p1 p2 [k3 [k4 k5 k6]]",
                    distortion.len()
                );
                return Err(problem(join(at, "distortion"), reason));
            }
            let range = -1e3..=1e3;
            distortion.iter().enumerate().try_for_each(|(k, v)| number(&format!("{at}.distortion[{k}]"), *v, &range))
        }
    }
}
