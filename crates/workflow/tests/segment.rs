//! `trocar segment`: from a recording to masks, and from these to a specimen.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use std::path::{Path, PathBuf};
use trocar_camera::Mask;
use trocar_core::Silent;
use trocar_reconstruct::{Settings, reconstruct};
use trocar_recording::{InstrumentInfo, InstrumentRule, Recording, RecordingInfo};
use trocar_testing::sphere::{self, info, write};
use trocar_workflow::{Segment, inspect, weight_files};

/// Networks with SAM's interface that select by colour; `None`, with a message, without ONNX
/// Runtime.
fn sam() -> Option<Segment> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tools = root.join("../../target/tools");
    let versions = std::fs::read_dir(tools.join("lib")).into_iter().flatten().flatten();
    let installed = versions.map(|v| v.path().join("site-packages/onnxruntime/capi")).any(|capi| capi.is_dir());
    if std::env::var_os("ORT_DYLIB_PATH").is_none() && !installed {
        println!("skipped: no ONNX Runtime; set ORT_DYLIB_PATH, or run `cargo xtask tools`");
        return None;
    }
    Some(Segment { sam: Some(root.join("../segment/tests/fixtures/plain")), onnxruntime: Some(tools) })
}

fn recording(info: &RecordingInfo) -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, info, 6);
    (root, dir)
}

fn iou(a: &Mask, b: &Mask) -> f64 {
    let count = |f: &dyn Fn(bool, bool) -> bool| a.set.iter().zip(&b.set).filter(|(a, b)| f(**a, **b)).count() as f64;
    count(&|a, b| a && b) / count(&|a, b| a || b)
}

#[test]
fn an_organ_with_points_is_found_and_reconstructed() {
    let Some(segment) = sam() else { return };
    let mut info = info();
    info.organs[0].points = vec![[82.0, 58.0]];
    // Before frame 2 the bar comes from the image's other side, where it cannot be followed.
    info.followed =
        vec![InstrumentInfo { name: "bar".into(), frame: 2, points: vec![[152.0, 30.0]], points_outside: vec![] }];
    let (root, dir) = recording(&info);
    let truth = Mask::read(&dir.join("masks/ball.png")).unwrap();
    let bar = Mask::read(&dir.join("masks/instruments/000004.png")).unwrap();

    let masks = root.path().join("masks");
    let made = segment.run(&dir, &masks, &Silent).unwrap();
    assert_eq!((made.frames, made.organs.len()), (6, 1));
    let found = Mask::read(&masks.join("ball.png")).unwrap();
    assert!(iou(&found, &truth) > 0.8, "{}", iou(&found, &truth));
    let followed = Mask::read(&masks.join("instruments/000004.png")).unwrap();
    assert!(iou(&followed, &bar) > 0.8, "{}", iou(&followed, &bar));

    std::fs::remove_file(dir.join("masks/ball.png")).unwrap();
    let settings = Settings { sam: segment.sam, onnxruntime: segment.onnxruntime, stride: 1, ..Settings::default() };
    let specimen = reconstruct(&Recording::open(&dir).unwrap(), &settings, &Silent).unwrap().specimen;
    let ratio = specimen.organs[0].surface.volume() / (4.0 / 3.0 * std::f64::consts::PI * sphere::RADIUS.powi(3));
    assert!((0.75..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn without_sam_metal_is_detected_and_points_are_refused() {
    let (root, dir) = recording(&info());
    let masks = root.path().join("masks");
    let made = Segment::default().run(&dir, &masks, &Silent).unwrap();
    assert!(
        made.frames == 6 && masks.join("instruments/000005.png").is_file() && masks.join("organs-seen.png").is_file()
    );

    let mut info = info();
    info.organs[0].points = vec![[82.0, 58.0]];
    let (_root, dir) = recording(&info);
    let error = Segment::default().run(&dir, &masks, &Silent).unwrap_err().to_string();
    assert!(error.contains("corrected by hand"), "{error}");
    let error = Segment::default().run(&dir, &root.path().join("other"), &Silent).unwrap_err().to_string();
    assert!(error.contains("recording.toml") && error.contains("--sam FOLDER"), "{error}");
    assert!(weight_files(None).iter().all(|w| w.found.is_none() || w.name.contains("ONNX Runtime")));
}

/// `instruments = "none"` leaves the frames without masks, whatever is marked; a recording in which
/// nothing is left to segment is refused.
#[test]
fn a_recording_without_instruments_gets_no_instrument_masks() {
    let mut info = info();
    info.instruments = InstrumentRule::None;
    info.followed =
        vec![InstrumentInfo { name: "bar".into(), frame: 2, points: vec![[152.0, 30.0]], points_outside: vec![] }];
    let (root, dir) = recording(&info);
    let masks = root.path().join("masks");
    let error = Segment::default().run(&dir, &masks, &Silent).unwrap_err().to_string();
    assert!(error.contains("recording.toml: there is nothing to segment: instruments = \"none\""), "{error}");
    assert!(!masks.exists());

    let Some(segment) = sam() else { return };
    info.organs[0].points = vec![[82.0, 58.0]];
    let (root, dir) = recording(&info);
    let masks = root.path().join("masks");
    let made = segment.run(&dir, &masks, &Silent).unwrap();
    assert_eq!((made.frames, made.instruments.as_str()), (0, "none, as the recording says"));
    assert!(masks.join("ball.png").is_file() && !masks.join("instruments").exists());
}

#[test]
fn an_organ_without_its_mask_is_named_as_missing() {
    let (_root, dir) = recording(&info());
    let whole = inspect(&dir, false).unwrap();
    assert_eq!((whole.organs.as_slice(), whole.missing.len()), (["ball".to_owned()].as_slice(), 0));
    std::fs::remove_file(dir.join("masks/ball.png")).unwrap();
    let without = inspect(&dir, false).unwrap();
    assert!(without.organs.is_empty());
    let [missing] = &without.missing[..] else { panic!("{:?}", without.missing) };
    assert!(missing.starts_with("organ 'ball' has no mask: ") && missing.contains("ball.png"), "{missing}");
}
