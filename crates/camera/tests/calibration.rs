//! Calibration files: round trips, files of other programs, and errors of one line.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{ROS, SAMPLE};
use trocar_camera::{Camera, CameraModel, Distortion, Fisheye};

fn parse(text: &str) -> Result<CameraModel, String> {
    CameraModel::parse_calibration(text.as_bytes())
}

#[test]
fn files_of_other_programs_are_read() {
    let CameraModel::Pinhole(camera) = parse(SAMPLE).unwrap() else { panic!("a pinhole") };
    assert_eq!((camera.width, camera.fx, camera.cy), (1280, 683.91, 359.5));
    assert_eq!(camera.distortion, Distortion([-0.12, 0.034, 1e-3, -2e-4, 0.0, 0.0, 0.0, 0.0]));
    let CameraModel::Fisheye(camera, lens) = parse(ROS).unwrap() else { panic!("a fisheye") };
    assert_eq!((camera.height, camera.fx, lens), (480, 525.0, Fisheye([0.01, -0.002, 0.0, 0.0])));
}

#[test]
fn files_are_read_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let rational =
        Camera { distortion: Distortion([0.1, 0.2, 1e-17, -0.3, 0.0, 1e300, 0.1 + 0.2, 7.0]), ..Camera::d405() };
    let models =
        [Camera::d405().into(), rational.into(), CameraModel::Fisheye(Camera::d405(), Fisheye([0.1, 0.0, -1e-9, 3.0]))];
    for model in models {
        for name in ["c.yml", "c.yaml", "c.json", "c.JSON"] {
            let path = folder.path().join(name);
            model.write_calibration(&path).unwrap();
            assert_eq!(CameraModel::read_calibration(&path).unwrap(), model, "{name}");
        }
    }
}

#[test]
fn errors_have_one_line() {
    let cases = [
        (SAMPLE.replace("camera_matrix", "camera"), "camera_matrix"),
        (SAMPLE.replace("3.595e+02, 0.,", "3.595e+02,"), "3 x 3, but has 8"),
        (SAMPLE.replace("6.8391e+02, 0.,", "6.8391e+02, 2.,"), "skewed"),
        (SAMPLE.replace("6.8391e+02", "-4."), "camera.fx"),
        (SAMPLE.replace("1280", "0"), "width"),
        (SAMPLE.replace("1280", "wide"), "line"),
        (ROS.replace("equidistant", "omnidirectional"), "omnidirectional"),
        (ROS.replace("cols: 4", "cols: 2").replace(", 0.0, 0.0]\nrect", "]\nrect"), "a fisheye lens must have 4"),
        (
            SAMPLE.replace("rows: 5", "rows: 3").replace("-2.0e-04, 0. ]", "]").replace("1.0e-03, ", "1.0e-03 "),
            "4, 5 or 8",
        ),
        ("{\"image_width\": 3}".into(), "image_height"),
        (String::new(), "not an OpenCV calibration"),
        ("%YAML:1.0".into(), "not an OpenCV calibration"),
    ];
    for (text, part) in cases {
        let error = parse(&text).unwrap_err();
        assert!(error.contains(part) && !error.contains('\n'), "'{error}' must contain '{part}'");
    }
    let error = CameraModel::read_calibration("no/such.yml".as_ref()).unwrap_err().to_string();
    assert!(error.starts_with("no/such.yml: "), "{error}");
}

#[test]
fn an_undistorted_picture_is_straight() {
    // A line of white pixels that the lens bends is straight again to one pixel.
    let lens = Camera { distortion: Distortion([-0.25, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ..Camera::d405() };
    let plain = Camera::d405();
    let mut image = trocar_camera::ColorImage::new(848, 480, [0; 3]);
    for i in 0..8000 {
        let p = lens.project(plain.ray(848.0 * f64::from(i) / 8000.0, 60.0)).unwrap().round();
        if (0.0..848.0).contains(&p.x) && (0.0..480.0).contains(&p.y) {
            image.pixels[p.y as usize * 848 + p.x as usize] = [255; 3];
        }
    }
    let model: CameraModel = lens.into();
    let straight = model.undistortion_map(&plain).apply(&image);
    for u in 20..828 {
        let brightest = (0..480).max_by_key(|v| straight.pixels[v * 848 + u][0]).unwrap();
        assert!(brightest.abs_diff(60) <= 1, "column {u}: row {brightest}");
    }
}
