//! Runs the SAM 2.1 path: ONNX Runtime on tiny networks with SAM's interface
//! (`fixtures/make_tiny_sam.py`). They select by colour, so every answer is known. Skipped with a
//! message where the runtime's library is missing.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

use std::path::{Path, PathBuf};
use trocar_camera::{ColorImage, Mask};
use trocar_segment::{Picture, Sam2, Segmenter, Target, Tracker};

const WIDTH: usize = 212;
const HEIGHT: usize = 120;
const RED: [u8; 3] = [200, 40, 40];
const BLUE: [u8; 3] = [40, 60, 210];
const PINK: [u8; 3] = [230, 150, 150];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// The networks, or `None` without the runtime.
fn open(name: &str) -> Option<Sam2> {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tools");
    // pip's path: lib/python3.11/site-packages/onnxruntime/capi.
    let versions = std::fs::read_dir(tools.join("lib")).into_iter().flatten().flatten();
    let installed = versions.map(|v| v.path().join("site-packages/onnxruntime/capi")).any(|capi| capi.is_dir());
    if std::env::var_os("ORT_DYLIB_PATH").is_none() && !installed {
        println!("skipped: no ONNX Runtime; set ORT_DYLIB_PATH, or make a Python environment with it in target/tools");
        return None;
    }
    Some(Sam2::open(&fixture(name), Some(&tools)).unwrap())
}

/// Coloured boxes (left, top, right, bottom, colour) on a blue ground.
fn paint(boxes: &[([usize; 4], [u8; 3])]) -> ColorImage {
    let mut image = ColorImage::new(WIDTH, HEIGHT, BLUE);
    for ([left, top, right, bottom], color) in boxes {
        for v in *top..*bottom {
            image.pixels[v * WIDTH + left..v * WIDTH + right].fill(*color);
        }
    }
    image
}

/// Intersection over union with a box. The networks' cells are 3.3 x 1.9 pixels, so a rim is always
/// lost.
fn iou(mask: &Mask, [left, top, right, bottom]: [usize; 4]) -> f64 {
    let inside = |i: usize| (left..right).contains(&(i % WIDTH)) && (top..bottom).contains(&(i / WIDTH));
    let both = (0..mask.set.len()).filter(|i| mask.set[*i] && inside(*i)).count();
    let either = (0..mask.set.len()).filter(|i| mask.set[*i] || inside(*i)).count();
    both as f64 / either as f64
}

fn target(points: &[[f64; 2]], outside: &[[f64; 2]]) -> Target {
    Target { name: "organ".into(), points: points.to_vec(), points_outside: outside.to_vec(), ..Target::default() }
}

fn picture(color: &ColorImage) -> Picture<'_> {
    Picture { color, depth: None, name: "frame 1" }
}

#[test]
fn points_boxes_and_outlines_select_what_they_point_at() {
    for name in ["plain", "sized"] {
        let Some(sam) = open(name) else { return };
        let (left, right) = ([20, 20, 90, 100], [130, 30, 190, 90]);
        let image = paint(&[(left, RED), (right, PINK)]);
        let find = |target: &Target| sam.segment(&picture(&image), target).unwrap();

        let mask = find(&target(&[[50.0, 50.0]], &[]));
        assert_eq!((mask.width, mask.height), (WIDTH, HEIGHT));
        assert!(iou(&mask, left) > 0.9, "{name}: {}", iou(&mask, left));
        assert!(iou(&find(&target(&[[160.0, 60.0]], &[])), right) > 0.9, "{name}");

        // Both clicked: both. The second clicked as outside, or nothing left for it: only the
        // first.
        let both = find(&target(&[[50.0, 50.0], [160.0, 60.0]], &[]));
        assert!(both.set[50 * WIDTH + 50] && both.set[60 * WIDTH + 160] && !both.set[60 * WIDTH + 110]);
        let first = find(&target(&[[50.0, 50.0]], &[[160.0, 60.0]]));
        assert!(iou(&first, left) > 0.9 && !first.set[60 * WIDTH + 160]);
        let none = find(&target(&[[50.0, 50.0]], &[[60.0, 60.0]]));
        assert_eq!(none.count(), 0, "{name}: clicked as on it and as outside it");

        let boxed = Target { name: "organ".into(), box_px: Some([125.0, 25.0, 195.0, 95.0]), ..Target::default() };
        assert!(iou(&find(&boxed), right) > 0.85, "{name}: {}", iou(&find(&boxed), right));
        let [l, t, r, b] = left.map(|c| c as f64);
        let outline = vec![[l - 4.0, t - 4.0], [r + 4.0, t - 4.0], [r + 4.0, b + 4.0], [l - 4.0, b + 4.0]];
        let outlined = Target { name: "organ".into(), polygon: outline, ..Target::default() };
        assert!(iou(&find(&outlined), left) > 0.85, "{name}: {}", iou(&find(&outlined), left));
    }
}

#[test]
fn tracking_follows_one_square_and_not_its_double() {
    for name in ["plain", "sized"] {
        let Some(sam) = open(name) else { return };
        let double = [160, 70, 200, 110];
        let square = |step: usize| [10 + 3 * step, 10 + 2 * step, 50 + 3 * step, 50 + 2 * step];
        let show = |step: usize| paint(&[(square(step), RED), (double, RED)]);
        let mut tracker = Tracker::new(&sam);
        let message = tracker.next(&picture(&show(0))).unwrap_err().to_string();
        assert!(message.contains("frame 1") && message.contains("start"), "{message}");

        // By colour alone both are included; the box selects one, and after that the mask prompt
        // does.
        let both = sam.segment(&picture(&show(0)), &target(&[[30.0, 30.0]], &[])).unwrap();
        assert!(both.set[90 * WIDTH + 180]);
        let only = Target { box_px: Some([5.0, 5.0, 55.0, 55.0]), ..target(&[[30.0, 30.0]], &[]) };
        assert!(iou(&tracker.start(&picture(&show(0)), &only).unwrap(), square(0)) > 0.85);
        for step in 1..=20 {
            let mask = tracker.next(&picture(&show(step))).unwrap();
            assert!(iou(&mask, square(step)) > 0.75, "{name}, step {step}: {}", iou(&mask, square(step)));
            assert!(!mask.set[108 * WIDTH + 198], "{name}, step {step}: took the double");
        }

        let other = ColorImage::new(WIDTH, HEIGHT + 1, RED);
        assert!(tracker.next(&picture(&other)).unwrap_err().to_string().contains("212 x 121"));
        let nothing = target(&[[30.0, 30.0]], &[[30.0, 30.0]]);
        assert!(tracker.start(&picture(&show(0)), &nothing).unwrap_err().to_string().contains("not found in frame 1"));
    }
}

#[test]
fn the_same_prompt_gives_the_same_bits() {
    let Some(sam) = open("plain") else { return };
    let (first, other) = (paint(&[([20, 20, 90, 100], RED)]), paint(&[([30, 20, 90, 90], PINK)]));
    let target = target(&[[50.0, 50.0]], &[]);
    let once = sam.segment(&picture(&first), &target).unwrap();
    // Another picture in between: the cached features of a picture must not serve another.
    assert_ne!(sam.segment(&picture(&other), &target).unwrap(), once);
    assert_eq!(sam.segment(&picture(&first), &target).unwrap(), once);
    assert!(sam.describe().contains("256 x 256"));
}

#[test]
fn files_that_are_no_sam_are_named() {
    let Some(_) = open("plain") else { return };
    let [encoder, decoder] = ["encoder", "decoder"].map(|w| fixture(&format!("plain/tiny.{w}.onnx")));
    let sized = fixture("sized/tiny_image_encoder.onnx");
    let whole = std::fs::read(&decoder).unwrap();
    let attempt = |first: &[u8], second: &[u8]| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("image_encoder.onnx"), first).unwrap();
        std::fs::write(dir.path().join("mask_decoder.onnx"), second).unwrap();
        Sam2::open(dir.path(), None).map(|sam| {
            let image = paint(&[]);
            sam.segment(&picture(&image), &target(&[[9.0, 9.0]], &[])).map(|_| ())
        })
    };
    let read = |path: &Path| std::fs::read(path).unwrap();
    let message = attempt(&read(&decoder), &whole).unwrap_err().to_string();
    assert!(message.contains("image_encoder.onnx") && message.contains("inputs"), "{message}");
    let message = attempt(&read(&encoder), &read(&encoder)).unwrap_err().to_string();
    assert!(message.contains("mask_decoder.onnx") && message.contains("'image'"), "{message}");
    for broken in [&whole[..0], &whole[..whole.len() / 2], b"no network at all"] {
        let message = attempt(&read(&encoder), broken).unwrap_err().to_string();
        assert!(message.contains("mask_decoder.onnx") && !message.contains('\n'), "{message}");
    }
    // Outputs with the other exporter's names still match by their roles.
    assert!(attempt(&read(&sized), &whole).unwrap().is_ok());
}
