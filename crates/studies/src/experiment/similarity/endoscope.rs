//! The camera of the endoscope.

use trocar_camera::{Camera, Endoscope};

/// The camera of the thirty-degree endoscope, scaled to pictures of `width` (px).
pub(super) fn endoscope_camera(width: usize) -> Camera {
    let camera = Endoscope::thirty_degrees().camera;
    let k = width as f64 / camera.width as f64;
    Camera {
        width,
        height: (camera.height as f64 * k).round() as usize,
        fx: camera.fx * k,
        fy: camera.fy * k,
        cx: (camera.cx + 0.5) * k - 0.5,
        cy: (camera.cy + 0.5) * k - 0.5,
        ..camera
    }
}
