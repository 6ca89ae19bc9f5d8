//! Damaged calibration files give errors, without panics, hangs or large allocations.

mod common;

use common::{ROS, SAMPLE};
use trocar_camera::CameraModel;
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

#[test]
fn damaged_files_are_errors() {
    let json = serde_json::json!({
        "image_width": 640, "image_height": 480,
        "camera_matrix": { "type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
            "data": [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0] },
        "distortion_coefficients": { "type_id": "opencv-matrix", "rows": 1, "cols": 4, "dt": "d", "data": [0.1, 0.0, 0.0, 0.0] },
    });
    let seeds = [
        ("opencv.yml".to_owned(), SAMPLE.as_bytes().to_vec()),
        ("ros.yaml".to_owned(), ROS.as_bytes().to_vec()),
        ("opencv.json".to_owned(), json.to_string().into_bytes()),
    ];
    seeds.iter().for_each(|(name, bytes)| assert!(CameraModel::parse_calibration(bytes).is_ok(), "{name}"));
    fuzz_reader(&seeds, Allowance { fixed: 4 << 20, per_byte: 1000 }, |_, bytes| {
        if let Ok(model) = CameraModel::parse_calibration(bytes) {
            // Every accepted file gives a usable model.
            for (u, v) in [(0.0, 0.0), (1e5, -3.0), (320.0, 200.0)] {
                let _ = model.unproject(u, v).and_then(|ray| model.project(ray));
            }
        }
    });
}
