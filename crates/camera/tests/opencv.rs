//! Camera models and calibration files agree with OpenCV to 1e-4 px. Skipped with a message without
//! OpenCV.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

use glam::DVec3;
use std::path::Path;
use std::process::Command;
use trocar_camera::{Camera, CameraModel, Distortion, Fisheye};
use trocar_testing::python_with;

/// Tolerance (px).
const TOLERANCE: f64 = 1e-4;

fn camera(distortion: [f64; 8]) -> Camera {
    let distortion = Distortion(distortion);
    Camera { width: 640, height: 360, fx: 341.9, fy: 348.7, cx: 322.4, cy: 176.1, distortion }
}

fn models() -> Vec<(&'static str, CameraModel)> {
    let five = [-0.12, 0.03, 1.27e-3, -1.1e-4, -0.002, 0.0, 0.0, 0.0];
    let eight = [0.5479, -0.0210, -7.21e-5, 2.06e-5, -0.00265, 0.8897, 0.0861, -0.0139];
    let fisheye = Fisheye([-0.021, 0.0034, -0.0006, 0.00004]);
    vec![
        ("pinhole", camera([0.0; 8]).into()),
        ("five", camera(five).into()),
        ("eight", camera(eight).into()),
        ("fisheye", CameraModel::Fisheye(camera([0.0; 8]), fisheye)),
    ]
}

fn write(path: &Path, numbers: impl IntoIterator<Item = f64>) {
    std::fs::write(path, numbers.into_iter().flat_map(f64::to_le_bytes).collect::<Vec<_>>()).unwrap();
}

fn read(path: &Path) -> Vec<[f64; 2]> {
    let bytes = std::fs::read(path).unwrap();
    let numbers: Vec<f64> = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    numbers.as_chunks().0.to_vec()
}

#[test]
fn every_model_agrees_with_opencv() {
    let Some(python) = python_with("cv2", "OpenCV") else { return };
    for (name, model) in models() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let steps = |n: usize| (0..n).map(move |i| i as f64 / (n - 1) as f64);
        let pixels: Vec<[f64; 2]> = steps(24).flat_map(|v| steps(32).map(move |u| [639.0 * u, 359.0 * v])).collect();
        let spread = if name == "fisheye" { 2.5 } else { 0.95 };
        let points: Vec<DVec3> = steps(31)
            .flat_map(|y| steps(31).map(move |x| spread * DVec3::new(2.0 * x - 1.0, 1.2 * y - 0.6, 0.0)))
            .enumerate()
            .map(|(i, p)| (p + DVec3::Z) * (0.05 + 0.01 * (i % 20) as f64))
            .collect();
        let plain = Camera { fx: 360.0, fy: 350.0, cx: 318.0, cy: 181.0, ..camera([0.0; 8]) };
        write(&file("points"), points.iter().flat_map(|p| p.to_array()));
        write(&file("pixels"), pixels.iter().flatten().copied());
        write(&file("plain"), [plain.fx, 0.0, plain.cx, 0.0, plain.fy, plain.cy, 0.0, 0.0, 1.0]);
        model.write_calibration(&file("calibration.yml")).unwrap();

        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/oracles/opencv.py");
        let output = Command::new(&python).arg(script).arg(folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

        let mut worst = [0.0_f64; 3];
        for (p, theirs) in points.iter().zip(read(&file("projected"))) {
            worst[0] = worst[0].max((model.project(*p).unwrap() - glam::DVec2::from(theirs)).length());
        }
        for (p, theirs) in pixels.iter().zip(read(&file("undistorted"))) {
            let ray = model.unproject(p[0], p[1]).unwrap();
            let ours = ray.truncate() / ray.z;
            worst[1] = worst[1].max(plain.fx * (ours - glam::DVec2::from(theirs)).length());
        }
        let map = model.undistortion_map(&plain);
        let theirs = read(&file("map"));
        assert_eq!(map.from.len(), theirs.len());
        for (ours, theirs) in map.from.iter().zip(theirs) {
            // OpenCV stores its maps in single precision: half a unit in the last place of 639 is
            // 3e-5.
            worst[2] = worst[2].max((*ours - glam::DVec2::from(theirs)).length());
        }
        assert!(worst.iter().all(|w| *w < TOLERANCE), "{name}: {worst:?}");
        for ending in ["yml", "json"] {
            let back = CameraModel::read_calibration(&file(&format!("back.{ending}"))).unwrap();
            assert_eq!(back, model, "{name} through OpenCV's {ending}");
        }
    }
}
