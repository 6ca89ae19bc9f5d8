//! The endoscope's camera.

use trocar_camera::{Camera, Endoscope};

/// The thirty-degree endoscope's camera with pictures of another width (px).
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
