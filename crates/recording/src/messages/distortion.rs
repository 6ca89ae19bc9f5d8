//! Converts the lens models that files name to OpenCV's.
//!
//! `plumb_bob` and `rational_polynomial` (ROS, foxglove) and `Brown Conrady` (librealsense) are
//! OpenCV's own. librealsense's `Inverse Brown Conrady` is the same polynomial in the other
//! direction (from the distorted to the ideal point); its `Modified Brown Conrady` applies the
//! tangential part after the radial (`rs2_deproject_pixel_to_point`, `rs2_project_point_to_pixel`).
//! For these two, OpenCV's five coefficients are fitted over the image. The fit is linear in them.

use super::error::Parsed;
use glam::DVec2;
use trocar_camera::{Camera, Distortion};

/// Largest error of the fit anywhere in the image (px).
const MAX_MISFIT: f64 = 0.5;
/// Points of the fit along a side of the image.
const GRID: usize = 25;

/// OpenCV's coefficients for model `name` with coefficients `d`.
pub(crate) fn convert(name: &str, d: &[f64], camera: &Camera) -> Parsed<Distortion> {
    if let Some(bad) = d.iter().find(|k| !k.is_finite()) {
        return Err(format!("a distortion coefficient is {bad}"));
    }
    let plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    if matches!(plain.as_str(), "equidistant" | "fisheye" | "ftheta" | "kannalabrandt" | "kannalabrandt4") {
        return Err(format!("the distortion model is '{name}', a fisheye; only pinhole cameras are supported"));
    }
    if d.iter().all(|&k| k == 0.0) {
        return Ok(Distortion::default());
    }
    match plain.as_str() {
        "plumbbob" | "rationalpolynomial" | "brownconrady" => {
            let more = d.iter().skip(8).any(|&k| k != 0.0);
            if more {
                return Err(format!("the distortion has {} coefficients; at most 8 are supported", d.len()));
            }
            Distortion::try_from(d.iter().copied().take(8).collect::<Vec<_>>())
        }
        "inversebrownconrady" => fit(camera, |q| (polynomial(d, q, q), q)),
        "modifiedbrownconrady" => fit(camera, |p| {
            let radial = scaled(d, p);
            (p, tangential(d, radial, p.length_squared()))
        }),
        _ => Err(format!(
            "the distortion model is '{name}'; supported are plumb_bob, rational_polynomial, and librealsense's Brown-Conrady models"
        )),
    }
}

fn coefficient(d: &[f64], i: usize) -> f64 {
    d.get(i).copied().unwrap_or(0.0)
}

/// `p` with the radial distortion.
fn scaled(d: &[f64], p: DVec2) -> DVec2 {
    let r2 = p.length_squared();
    p * (1.0 + r2 * (coefficient(d, 0) + r2 * (coefficient(d, 1) + r2 * coefficient(d, 4))))
}

/// `p` with the tangential distortion, computed from `p` itself.
fn tangential(d: &[f64], p: DVec2, r2: f64) -> DVec2 {
    let (p1, p2) = (coefficient(d, 2), coefficient(d, 3));
    let xy = 2.0 * p.x * p.y;
    p + DVec2::new(p1 * xy + p2 * (r2 + 2.0 * p.x * p.x), p2 * xy + p1 * (r2 + 2.0 * p.y * p.y))
}

/// Brown's polynomial at `p`, with the tangential part computed from `t`.
fn polynomial(d: &[f64], p: DVec2, t: DVec2) -> DVec2 {
    scaled(d, p) + tangential(d, t, t.length_squared()) - t
}

/// The coefficients k1 k2 p1 p2 k3 that map ideal to distorted points best (least squares). `pair`
/// returns both for a point; it is called for a grid of points over the image.
fn fit(camera: &Camera, pair: impl Fn(DVec2) -> (DVec2, DVec2)) -> Parsed<Distortion> {
    let steps = (0..GRID).map(|i| i as f64 / (GRID - 1) as f64);
    let at = |u: f64, v: f64| {
        let pixel = DVec2::new(u * (camera.width as f64 - 1.0), v * (camera.height as f64 - 1.0));
        (pixel - DVec2::new(camera.cx, camera.cy)) / DVec2::new(camera.fx, camera.fy)
    };
    let pairs: Vec<(DVec2, DVec2)> =
        steps.clone().flat_map(|v| steps.clone().map(move |u| (u, v))).map(|(u, v)| pair(at(u, v))).collect();
    let mut normal = [[0.0; 6]; 5];
    for &(p, q) in &pairs {
        let (r2, xy) = (p.length_squared(), 2.0 * p.x * p.y);
        let rest = q - p;
        let rows = [
            [p.x * r2, p.x * r2 * r2, xy, r2 + 2.0 * p.x * p.x, p.x * r2 * r2 * r2, rest.x],
            [p.y * r2, p.y * r2 * r2, r2 + 2.0 * p.y * p.y, xy, p.y * r2 * r2 * r2, rest.y],
        ];
        for row in rows {
            for i in 0..5 {
                for j in 0..6 {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
    }
    let [k1, k2, p1, p2, k3] = solve(normal).ok_or("the distortion cannot be fitted by OpenCV's model")?;
    let fitted = [k1, k2, p1, p2, k3];
    let misfit = pairs
        .iter()
        .map(|&(p, q)| ((polynomial(&fitted, p, p) - q) * DVec2::new(camera.fx, camera.fy)).length())
        .fold(0.0, f64::max);
    // Written so that NaN fails too.
    if misfit <= MAX_MISFIT {
        Ok(Distortion([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]))
    } else {
        Err(format!("OpenCV's model fits the distortion to {misfit:.2} px only; it must fit to {MAX_MISFIT} px"))
    }
}

/// Gaussian elimination with row pivoting; the last column is the right-hand side.
fn solve(mut m: [[f64; 6]; 5]) -> Option<[f64; 5]> {
    for c in 0..5 {
        let pivot = (c..5).max_by(|&a, &b| m[a][c].abs().total_cmp(&m[b][c].abs()))?;
        m.swap(c, pivot);
        if m[c][c] == 0.0 || !m[c][c].is_finite() {
            return None;
        }
        for r in 0..5 {
            if r != c {
                let factor = m[r][c] / m[c][c];
                for k in c..6 {
                    m[r][k] -= factor * m[c][k];
                }
            }
        }
    }
    Some(std::array::from_fn(|i| m[i][5] / m[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn camera(distortion: Distortion) -> Camera {
        Camera { width: 1280, height: 720, fx: 640.0, fy: 641.0, cx: 645.0, cy: 362.0, distortion }
    }

    /// A D405's colour stream: checks against librealsense's formula for the inverse polynomial.
    #[test]
    fn an_inverse_model_is_fitted() {
        let d = [-0.0548, 0.0617, -0.0003, 0.0009, -0.0199];
        let plain = camera(Distortion::default());
        let fitted = camera(convert("Inverse Brown Conrady", &d, &plain).unwrap());
        let mut worst: f64 = 0.0;
        for (u, v) in [(0.0, 0.0), (1279.0, 0.0), (640.0, 10.0), (100.0, 700.0), (900.0, 400.0)] {
            let (x, y) = ((u - plain.cx) / plain.fx, (v - plain.cy) / plain.fy);
            let r2: f64 = x * x + y * y;
            let f = 1.0 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2;
            let ideal = DVec3::new(
                x * f + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x),
                y * f + 2.0 * d[3] * x * y + d[2] * (r2 + 2.0 * y * y),
                1.0,
            );
            worst = worst.max((fitted.project(ideal).unwrap() - DVec2::new(u, v)).length());
            assert!((plain.project(ideal).unwrap() - DVec2::new(u, v)).length() > 0.5 || f - 1.0 < 0.01);
        }
        assert!(worst < 0.1, "{worst} px");
    }

    #[test]
    fn a_modified_model_is_fitted() {
        let d = [0.12, -0.05, 0.001, -0.002, 0.01];
        let plain = camera(Distortion::default());
        let fitted = camera(convert("Modified Brown Conrady", &d, &plain).unwrap());
        let (x, y) = (0.3, -0.25);
        let r2 = x * x + y * y;
        let f = 1.0 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2;
        let (xf, yf) = (x * f, y * f);
        let expected = DVec2::new(
            (xf + 2.0 * d[2] * xf * yf + d[3] * (r2 + 2.0 * xf * xf)) * plain.fx + plain.cx,
            (yf + 2.0 * d[3] * xf * yf + d[2] * (r2 + 2.0 * yf * yf)) * plain.fy + plain.cy,
        );
        assert!((fitted.project(DVec3::new(x, y, 1.0)).unwrap() - expected).length() < 0.1);
    }

    #[test]
    fn unsupported_models_are_refused() {
        let plain = camera(Distortion::default());
        assert!(convert("equidistant", &[0.0; 4], &plain).unwrap_err().contains("fisheye"));
        assert!(
            convert("Inverse Brown Conrady", &[-3.0, 9.0, 0.0, 0.0, -40.0], &plain).unwrap_err().contains("px only")
        );
        assert!(convert("lens", &[0.1], &plain).unwrap_err().contains("'lens'"));
        assert!(convert("plumb_bob", &[f64::NAN], &plain).is_err());
        assert_eq!(convert("", &[0.0; 5], &plain).unwrap(), Distortion::default());
    }
}
