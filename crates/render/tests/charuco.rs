//! Renders a ChArUco board and calibrates the camera from the pictures with OpenCV. The result must
//! be the camera that rendered them. Prints that it is skipped if OpenCV is missing.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "test helpers may panic")]

use glam::{DQuat, DVec3};
use std::path::{Path, PathBuf};
use std::process::Command;
use trocar_camera::{Camera, CameraModel, ColorImage, Distortion, Fisheye};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, Film, RayGenerator, RenderSettings, Stage, render, srgb};

/// Number of squares of the board.
const COLUMNS: usize = 10;
const ROWS: usize = 8;
/// Cells per side of a square, and the side of a cell (m).
const CELLS: usize = 12;
const CELL: f64 = 1.25e-3;
/// White margin around the board, in cells.
const MARGIN: usize = 4;
/// Supersampling factor per side of a pixel.
const FINER: usize = 3;
const POSES: usize = 30;

/// The Python interpreter with OpenCV's ArUco, if it is installed.
fn python() -> Option<PathBuf> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tools/bin/python");
    let imports = Command::new(&python).args(["-c", "import cv2; cv2.aruco.CharucoDetector"]).output();
    if imports.is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    println!("skipped: no OpenCV with ArUco in target/tools; `cargo xtask tools` fetches it");
    None
}

fn script(python: &Path, arguments: &[&str]) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/oracles/charuco.py");
    let output = Command::new(python).arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The board in its own plane, centred at the origin. Each cell is a quad with its own vertices, so
/// that colours do not blend.
fn board(cells: &[u8]) -> TriMesh {
    let (columns, rows) = (CELLS * COLUMNS, CELLS * ROWS);
    let mut mesh = TriMesh::default();
    let middle = 0.5 * DVec3::new(columns as f64, rows as f64, 0.0);
    for y in 0..rows + 2 * MARGIN {
        for x in 0..columns + 2 * MARGIN {
            let inside = x.checked_sub(MARGIN).zip(y.checked_sub(MARGIN)).filter(|(x, y)| *x < columns && *y < rows);
            let white = inside.is_none_or(|(x, y)| cells[y * columns + x] > 127);
            let first = mesh.vertices.len() as u32;
            let corner = DVec3::new(x as f64 - MARGIN as f64, y as f64 - MARGIN as f64, 0.0) - middle;
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                mesh.vertices.push(CELL * (corner + DVec3::new(dx, dy, 0.0)));
                mesh.colors.push(if white { [225; 3] } else { [35; 3] });
            }
            mesh.triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
        }
    }
    mesh
}

/// Poses of the board in the camera frame: near and far, all over the picture, tilted by 23 to 52
/// degrees in all directions and rotated.
fn poses(model: &CameraModel) -> Vec<Pose> {
    let camera = model.camera();
    // A low-discrepancy sequence in the unit cube (Roberts' R4 sequence).
    let share = |i: usize, k: i32| (0.5 + i as f64 * 1.167_303_978_261_418_7_f64.powi(-k)).fract();
    (0..POSES)
        .map(|i| {
            let [a, b, c, d] = [1, 2, 3, 4].map(|k| share(i, k));
            let place = [(a, camera.width), (b, camera.height)].map(|(s, n)| (0.15 + 0.7 * s) * n as f64);
            let towards = model.unproject(place[0], place[1]).unwrap();
            let distance = 0.11 + 0.10 * c;
            let round = std::f64::consts::TAU * (d + 0.1 * i as f64);
            let tilt = DQuat::from_axis_angle(DVec3::new(round.cos(), round.sin(), 0.0), 0.4 + 0.5 * a);
            let facing = DQuat::from_rotation_arc(DVec3::Z, towards);
            let turned = facing * tilt * DQuat::from_rotation_z(std::f64::consts::TAU * b);
            Pose { rotation: turned, translation: distance * towards }
        })
        .collect()
}

/// The camera with `FINER` times as many pixels per side.
fn finer(model: &CameraModel) -> CameraModel {
    let k = FINER as f64;
    let fine = |c: &Camera| Camera {
        width: c.width * FINER,
        height: c.height * FINER,
        fx: c.fx * k,
        fy: c.fy * k,
        cx: (c.cx + 0.5) * k - 0.5,
        cy: (c.cy + 0.5) * k - 0.5,
        distortion: c.distortion,
    };
    match model {
        CameraModel::Pinhole(camera) => fine(camera).into(),
        CameraModel::Fisheye(camera, lens) => CameraModel::Fisheye(fine(camera), *lens),
    }
}

/// Averages the light over blocks of `FINER` x `FINER` pixels.
fn reduced(light: &[[f32; 3]], width: usize, height: usize) -> ColorImage {
    let mut out = ColorImage::new(width, height, [0; 3]);
    for (i, pixel) in out.pixels.iter_mut().enumerate() {
        let (u, v) = (i % width * FINER, i / width * FINER);
        let mut sum = [0.0; 3];
        for k in 0..FINER * FINER {
            let l = light[(v + k / FINER) * width * FINER + u + k % FINER];
            sum = [0, 1, 2].map(|c| sum[c] + l[c] / (FINER * FINER) as f32);
        }
        *pixel = srgb::from_linear(sum);
    }
    out
}

/// Renders the board through `model` and calibrates the camera. Returns the RMS reprojection error
/// (px) and the largest relative error of the intrinsics.
fn calibrated(python: &Path, name: &str, model: &CameraModel) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let size = [COLUMNS.to_string(), ROWS.to_string()];
    script(python, &["board", path, &size[0], &size[1]]);
    let mut stage = Stage::new();
    stage.environment = [1.0; 3];
    let shape = stage.add_shape(&board(&std::fs::read(folder.path().join("board")).unwrap())).unwrap();
    let body = stage.add_body(shape, &Pose::IDENTITY, 1, &Appearance::matte([128; 3])).unwrap();
    let eye = RayGenerator::new(finer(model));
    let (width, height) = (model.camera().width, model.camera().height);
    for (i, pose) in poses(model).iter().enumerate() {
        stage.place(body, pose).unwrap();
        let settings = RenderSettings::Preview { shadows: false };
        let picture = render(&mut stage, &eye, &Pose::IDENTITY, &settings, &Film::default());
        let picture = reduced(&picture.light, width, height);
        picture.write_png(&folder.path().join(format!("{i:02}.png"))).unwrap();
        if let Some(keep) = std::env::var_os("TROCAR_KEEP_PICTURES") {
            picture.write_png(&Path::new(&keep).join(format!("{name}-{i:02}.png"))).unwrap();
        }
    }
    let lens = if matches!(model, CameraModel::Fisheye(..)) { "fisheye" } else { "pinhole" };
    let side = (CELL * CELLS as f64).to_string();
    script(python, &["calibrate", path, &size[0], &size[1], &side, lens]);
    let bytes = std::fs::read(folder.path().join("out")).unwrap();
    let out: Vec<f64> = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let camera = model.camera();
    let truth = [camera.fx, camera.fy, camera.cx, camera.cy];
    let worst = truth.iter().zip(&out[3..]).map(|(t, o)| (o / t - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "{name}: {} pictures, {} corners, RMS {:.4} px, fx {:.3} fy {:.3} cx {:.3} cy {:.3} of {truth:?}, off {:.4}%; lens {:?}",
        out[0],
        out[1],
        out[2],
        out[3],
        out[4],
        out[5],
        out[6],
        100.0 * worst,
        &out[7..]
    );
    assert!(out[0] >= 0.9 * POSES as f64, "{name}: the board was found in {} pictures of {POSES}", out[0]);
    (out[2], worst)
}

#[test]
fn opencv_recovers_the_rendering_camera() {
    let Some(python) = python() else { return };
    let camera = Camera {
        width: 800,
        height: 500,
        fx: 481.9,
        fy: 488.7,
        cx: 404.4,
        cy: 243.1,
        distortion: Distortion([-0.12, 0.03, 1.27e-3, -1.1e-4, -0.002, 0.0, 0.0, 0.0]),
    };
    let plain = Camera { fx: 391.9, fy: 388.7, distortion: Distortion::default(), ..camera };
    let models = [
        ("five", CameraModel::from(camera)),
        ("fisheye", CameraModel::Fisheye(plain, Fisheye([-0.021, 0.0034, -0.0006, 0.00004]))),
    ];
    for (name, model) in models {
        let (rms, worst) = calibrated(&python, name, &model);
        assert!(rms < 0.1, "{name}: RMS {rms} px");
        assert!(worst < 1e-3, "{name}: intrinsics off by {:.3}%", 100.0 * worst);
    }
}
