//! A missing or unusable organ mask is one clear error, found before any work.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};
use trocar_camera::Mask;
use trocar_core::Silent;
use trocar_reconstruct::{Settings, reconstruct};
use trocar_recording::{Recording, RecordingInfo};
use trocar_testing::sphere::{info, write};

fn recording(info: &RecordingInfo) -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, info, 3);
    (root, dir)
}

fn failure(dir: &Path) -> String {
    let recording = Recording::open(dir).unwrap();
    reconstruct(&recording, &Settings::default(), &Silent).expect_err("an unusable mask was accepted").to_string()
}

#[test]
fn unusable_masks_are_named() {
    let (_root, dir) = recording(&info());
    let mask = dir.join("masks/ball.png");
    Mask::new(160, 120).write_png(&mask).unwrap();
    let error = failure(&dir);
    assert!(error.contains("organ 'ball'") && error.contains("no pixel"), "{error}");
    Mask::new(16, 12).write_png(&mask).unwrap();
    let error = failure(&dir);
    assert!(error.contains("ball.png") && error.contains("16 x 12"), "{error}");
    fs::remove_file(&mask).unwrap();
    assert!(failure(&dir).contains("no mask"));
}

#[test]
fn a_polygon_beside_the_image_is_named() {
    let mut info = info();
    info.organs[0].polygon = vec![[-9.0, -9.0], [-8.0, -9.0], [-9.0, -8.0]];
    let (_root, dir) = recording(&info);
    let error = failure(&dir);
    assert!(error.contains("organ 'ball'") && error.contains("no pixel"), "{error}");
}

#[test]
fn points_ask_for_sam() {
    let mut info = info();
    info.organs[0].points = vec![[80.0, 60.0]];
    let (_root, dir) = recording(&info);
    assert!(
        reconstruct(&Recording::open(&dir).unwrap(), &Settings::default(), &Silent).is_ok(),
        "the mask file is enough"
    );
    fs::remove_file(dir.join("masks/ball.png")).unwrap();
    assert!(failure(&dir).contains("--sam FOLDER"));
    let settings = Settings { sam: Some(dir.join("nowhere")), ..Settings::default() };
    let error = reconstruct(&Recording::open(&dir).unwrap(), &settings, &Silent).unwrap_err().to_string();
    assert!(error.contains("nowhere") && !error.contains('\n'), "{error}");
}

#[test]
fn metal_is_found_where_the_recording_says_so() {
    let mut info = info();
    info.instruments = trocar_recording::InstrumentRule::None;
    let (_root, dir) = recording(&info);
    let made = reconstruct(&Recording::open(&dir).unwrap(), &Settings::default(), &Silent).unwrap();
    assert_eq!(made.composite.instruments.count(), 0, "the masks are there, but the recording says none");
    let toml = dir.join("recording.toml");
    let text = fs::read_to_string(&toml).unwrap().replace("instruments = \"none\"", "instruments = \"metal\"");
    fs::write(&toml, text).unwrap();
    assert!(reconstruct(&Recording::open(&dir).unwrap(), &Settings::default(), &Silent).is_ok());
}

#[test]
fn broken_frames_are_left_out_with_a_note() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, &info(), 12);
    for i in [2, 6] {
        let path = dir.join(format!("depth/{i:06}.png"));
        let png = fs::read(&path).unwrap();
        fs::write(&path, &png[..png.len() / 2]).unwrap();
    }
    let made =
        reconstruct(&Recording::open(&dir).unwrap(), &Settings { stride: 1, ..Settings::default() }, &Silent).unwrap();
    assert_eq!(made.composite.frames_used, 10);
    let noted = made.notes.iter().any(|n| n.contains("2 of 12 frames are broken") && n.contains("depth/000002.png"));
    assert!(noted, "{:?}", made.notes);
}
