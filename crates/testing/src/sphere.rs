//! A small recording of a sphere on a bed, seen from above, with a bar that moves across it.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "helpers of tests may panic")]

use glam::DVec3;
use std::path::Path;
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_recording::{OrganInfo, RecordingInfo, RecordingWriter};

/// Depth of the bed (m).
pub const BED: f64 = 0.30;
/// Centre of the sphere in the camera's frame (m).
pub const CENTRE: DVec3 = DVec3::new(0.004, -0.002, 0.275);
/// Its radius (m).
pub const RADIUS: f64 = 0.025;

/// The description of the recording.
pub fn info() -> RecordingInfo {
    RecordingInfo {
        name: "sphere".into(),
        rate_hz: Some(30.0),
        depth_scale_m: Some(0.001),
        up: [0.0, 0.0, -1.0],
        camera: Some(Camera { fx: 200.0, fy: 200.0, ..Camera::centred(160, 120, 1.0) }),
        organs: vec![OrganInfo { name: "ball".into(), ..OrganInfo::default() }],
        ..RecordingInfo::default()
    }
}

/// The truth: exact depth, colour and the sphere's mask.
pub fn scene(camera: &Camera) -> (ColorImage, DepthImage, Mask) {
    scene_at(camera, CENTRE)
}

/// The truth with the sphere's centre at `centre` (m).
pub fn scene_at(camera: &Camera, centre: DVec3) -> (ColorImage, DepthImage, Mask) {
    let (w, h) = (camera.width, camera.height);
    let mut color = ColorImage::new(w, h, [90, 90, 100]);
    let (mut depth, mut mask) = (DepthImage::new(w, h), Mask::new(w, h));
    for v in 0..h {
        for u in 0..w {
            let ray = camera.ray(u as f64, v as f64);
            let i = v * w + u;
            depth.depth[i] = BED as f32;
            // |t ray - c| = r
            let (a, b, c) = (ray.length_squared(), ray.dot(centre), centre.length_squared() - RADIUS * RADIUS);
            let d = b * b - a * c;
            if d >= 0.0 {
                depth.depth[i] = ((b - d.sqrt()) / a) as f32;
                mask.set[i] = true;
                color.pixels[i] = [180, 60, 50];
            }
        }
    }
    (color, depth, mask)
}

/// Writes `frames` frames. The bar covers a third of the frames at each column it passes; depth
/// under it is a hole.
pub fn write(dir: &Path, info: &RecordingInfo, frames: usize) {
    write_moving(dir, info, frames, |_| CENTRE);
}

/// [`write()`] with the sphere's centre at `centre(frame)` (m); its mask is that of `CENTRE`.
pub fn write_moving(dir: &Path, info: &RecordingInfo, frames: usize, centre: impl Fn(usize) -> DVec3) {
    let camera = info.camera.unwrap();
    let mask = scene(&camera).2;
    let writer = RecordingWriter::create(dir, info).unwrap();
    let w = camera.width;
    for f in (0..frames).rev() {
        let (mut color, mut depth, _) = scene_at(&camera, centre(f));
        let mut instruments = Mask::new(w, color.height);
        for v in 0..color.height {
            for u in 0..w {
                if (u + 7 * f) % w < 20 {
                    let i = v * w + u;
                    instruments.set[i] = true;
                    color.pixels[i] = [250; 3];
                    depth.depth[i] = if v % 2 == 0 { 0.0 } else { 0.2 };
                }
            }
        }
        writer.frame(f, &color, &depth, Some(&instruments)).unwrap();
    }
    writer.organ_mask("ball", &mask).unwrap();
    writer.finish().unwrap();
}
