//! Recordings are read as written, and every wrong input is one clear error.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_recording::{LiftInfo, Recording, RecordingWriter};
use trocar_testing::sphere::{self, info, write};

/// A new recording of three frames for a test to damage.
fn recording() -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, &info(), 3);
    (root, dir)
}

/// Opens and decodes everything; returns the error's text.
fn failure(dir: &Path) -> String {
    let everything = || -> trocar_recording::Result<()> {
        let recording = Recording::open(dir)?;
        for i in 0..recording.len() {
            recording.frame(i)?;
        }
        Ok(())
    };
    everything().expect_err("bad input was accepted").to_string()
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from} is not in {text}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn is_read_as_written() {
    let (_root, dir) = recording();
    let recording = Recording::open(&dir).unwrap();
    assert_eq!(recording.info, info());
    assert_eq!(recording.len(), 3);
    let frame = recording.frame(1).unwrap();
    let (color, depth, mask) = sphere::scene(&recording.camera());
    let i = 60 * 160 + 80;
    assert_eq!(frame.color.pixels[i], color.pixels[i]);
    assert!((frame.depth.depth[i] - depth.depth[i]).abs() <= 0.5001e-3);
    assert!(frame.instruments.count() > 0);
    assert_eq!(Mask::read(&dir.join("masks/ball.png")).unwrap(), mask);
    let csv = fs::read_to_string(dir.join("frames.csv")).unwrap();
    assert!(csv.lines().nth(2).unwrap().starts_with("1,0.033333,color/000001.png,depth/000001.png,masks/"), "{csv}");
}

#[test]
fn pairs_files_without_an_index() {
    let (_root, dir) = recording();
    fs::remove_file(dir.join("frames.csv")).unwrap();
    fs::remove_file(dir.join("color/000001.png")).unwrap();
    let recording = Recording::open(&dir).unwrap();
    assert_eq!(recording.len(), 2);
    assert!(recording.notes()[0].contains("2 colour and 3 depth"), "{:?}", recording.notes());
    assert!(recording.frame(1).unwrap().instruments.count() > 0);

    fs::remove_dir_all(dir.join("color")).unwrap();
    let recording = Recording::open(&dir).unwrap();
    assert_eq!(recording.len(), 3);
    assert!(recording.notes()[0].contains("no colour"));
    let [r, g, b] = recording.frame(0).unwrap().color.pixels[60 * 160 + 80];
    assert!(r == g && g == b && r > 150, "a patch that faces the camera is bright");
}

#[test]
fn moves_depth_onto_colour() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    let mut info = info();
    info.depth_offset_px = [3.0, -2.2];
    info.depth_max_m = Some(0.29);
    write(&dir, &info, 1);
    let recording = Recording::open(&dir).unwrap();
    let raw = DepthImage::read(&dir.join("depth/000000.png"), 0.001).unwrap();
    let frame = recording.frame(0).unwrap();
    assert!(frame.depth.depth[(60 - 2) * 160 + 83] > 0.0);
    assert_eq!(frame.depth.depth[(61 - 2) * 160 + 83], raw.depth[61 * 160 + 80]);
    assert!(frame.depth.depth.iter().all(|z| *z <= 0.29));
    assert_eq!((recording.camera().cx, recording.camera().cy), (82.5, 57.5));
}

#[test]
fn a_missing_or_foreign_folder_is_named() {
    let root = tempfile::tempdir().unwrap();
    assert!(failure(&root.path().join("nowhere")).contains("nowhere: no such file or folder"));
    assert!(failure(root.path()).contains("recording.toml: no such file"));
    fs::write(root.path().join("thesis"), "x").unwrap();
    let error = RecordingWriter::create(root.path(), &info()).err().unwrap().to_string();
    assert!(error.contains("holds no recording.toml"), "{error}");
}

#[test]
fn mistakes_in_the_toml_name_the_field() {
    for (from, to, expected) in [
        ("rate_hz = 30.0", "ratehz = 30.0", "did you mean `rate_hz`?"),
        ("width = 160", "widht = 160", "did you mean `width`?"),
        ("young_modulus_pa", "youngs_modulus_pa", "did you mean `young_modulus_pa`?"),
        ("share = 0.42", "shares = 0.42", "did you mean `share`?"),
        ("rate_hz = 30.0", "rate_hz = 0.0", "rate_hz is 0"),
        ("rate_hz = 30.0", "rate_hz = nan", "rate_hz is NaN"),
        ("depth_scale_m = 0.001", "depth_scale_m = 1.0", "depth_scale_m is 1"),
        ("fx = 200.0", "fx = -200.0", "camera.fx is -200"),
        ("up = [0.0, 0.0, -1.0]", "up = [0.0, 0.0, 0.0]", "up is"),
        ("name = \"ball\"", "name = \"../ball\"", "organ[0].name"),
        ("name = \"ball\"", "name = \"ball\"\npolygon = [[1.0, 2.0], [3.0, 4.0]]", "polygon has 2 points"),
        ("fx = 200.0", "fx = 1e300", "camera.fx is 1e300"),
        ("cx = 79.5", "cx = 1e9", "camera.cx is 1000000000"),
        ("up = [", "depth_scale = 0.001\nup = [", "did you mean `depth_scale_m`?"),
        ("depth_scale_m = 0.001\n", "", "missing field `depth_scale_m`"),
        ("rate_hz = 30.0", "instruments = \"steel\"", "unknown variant `steel`"),
        ("name = \"ball\"", "name = \"ball\"\nbase_px = [160.0, 2.0]", "base_px"),
        ("poisson_ratio = 0.45", "poisson_ratio = 0.5", "material.poisson_ratio is 0.5"),
        ("share = 0.42", "share = 42.0", "pins.share is 42"),
        ("name = \"sphere\"", "name = ", "line 1"),
    ] {
        let (_root, dir) = recording();
        replace(&dir.join("recording.toml"), from, to);
        let error = failure(&dir);
        assert!(error.contains(expected), "{to}: {error}");
        assert!(error.contains("recording.toml") || error.contains("organ 'ball'"), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
    let (_root, dir) = recording();
    let text = fs::read_to_string(dir.join("recording.toml")).unwrap();
    let organ = text.split_once("[[organ]]").unwrap().1.to_owned();
    fs::write(dir.join("recording.toml"), format!("{text}\n[[organ]]{organ}")).unwrap();
    assert!(failure(&dir).contains("a second time"));
}

#[test]
fn mistakes_in_the_index_name_the_line() {
    for (from, to, expected) in [
        ("color/000001.png", "../color/000001.png", "line 3: color is '../color/000001.png'"),
        ("color/000001.png", "/etc/passwd", "line 3: color"),
        ("1,0.0", "0,0.0", "indices must ascend"),
        ("index,time_s", "index,time", "time"),
        ("depth/000001.png", "", "depth is empty"),
        ("1,0.033333", "1,soon", "line 3: column 2: invalid float"),
    ] {
        let (_root, dir) = recording();
        replace(&dir.join("frames.csv"), from, to);
        let error = failure(&dir);
        assert!(error.contains(expected) && error.contains("frames.csv"), "{to}: {error}");
    }
    let (_root, dir) = recording();
    fs::remove_file(dir.join("depth/000001.png")).unwrap();
    let recording = Recording::open(&dir).unwrap();
    assert_eq!(recording.len(), 2);
    assert!(recording.notes()[0].contains("depth/000001.png"), "{:?}", recording.notes());
}

#[test]
fn damaged_images_are_named() {
    let (_root, dir) = recording();
    let path = dir.join("depth/000002.png");
    let png = fs::read(&path).unwrap();
    fs::write(&path, &png[..png.len() / 2]).unwrap();
    assert!(failure(&dir).contains("depth/000002.png"));

    let (_root, dir) = recording();
    DepthImage::new(80, 60).write_png(&dir.join("depth/000001.png"), 0.001).unwrap();
    let error = failure(&dir);
    assert!(["depth/000001.png", "80 x 60", "160 x 120"].iter().all(|s| error.contains(s)), "{error}");

    let (_root, dir) = recording();
    ColorImage::new(160, 120, [0; 3]).write_png(&dir.join("depth/000001.png")).unwrap();
    assert!(failure(&dir).contains("16-bit"));

    let (_root, dir) = recording();
    replace(&dir.join("recording.toml"), "width = 160", "width = 161");
    let error = failure(&dir);
    assert!(error.contains("160 x 120") && error.contains("161 x 120"), "{error}");
}

#[test]
fn missing_parts_are_named() {
    let (_root, dir) = recording();
    fs::remove_file(dir.join("frames.csv")).unwrap();
    for i in 0..3 {
        fs::remove_file(dir.join(format!("depth/{i:06}.png"))).unwrap();
    }
    assert!(failure(&dir).contains("no frames"));
    fs::remove_dir(dir.join("depth")).unwrap();
    assert!(failure(&dir).contains("depth: the folder does not exist"));

    let (_root, dir) = recording();
    fs::write(dir.join("frames.csv"), "index,time_s,color,depth,instruments\n").unwrap();
    assert!(failure(&dir).contains("no frames"));
}

#[test]
fn a_broken_frame_is_not_a_broken_recording() {
    let (_root, dir) = recording();
    fs::write(dir.join("depth/000000.png"), b"not an image").unwrap();
    let recording = Recording::open(&dir).unwrap();
    let frames: Vec<_> = recording.packets(&[0, 1, 2]).map(|p| (p.frame, p.parts.is_ok())).collect();
    assert_eq!(frames, [(0, true), (1, true), (2, true)], "what it holds shows only when it is decoded");
    assert!(recording.frame(0).unwrap_err().to_string().contains("depth/000000.png"));
    assert!(recording.frame(2).is_ok());
}

#[test]
fn times_in_file_names_pair_streams_of_unequal_length() {
    let (_root, dir) = recording();
    fs::remove_file(dir.join("frames.csv")).unwrap();
    fs::remove_dir_all(dir.join("masks/instruments")).unwrap();
    for (i, (color, depth)) in [(12.004, 12.0), (12.037, 12.066), (12.070, 12.1)].into_iter().enumerate() {
        for (folder, time) in [("color", color), ("depth", depth)] {
            let name = format!("{folder}_{time:.4}.png");
            fs::rename(dir.join(format!("{folder}/{i:06}.png")), dir.join(folder).join(name)).unwrap();
        }
    }
    let recording = Recording::open(&dir).unwrap();
    assert_eq!(recording.len(), 2);
    assert!(recording.frame_name(1).ends_with("depth_12.0660.png"), "{}", recording.frame_name(1));
    assert!(recording.notes()[0].contains("1 colour and 1 depth"), "{:?}", recording.notes());
}

#[test]
fn masks_made_later_are_found_by_name() {
    let (_root, dir) = recording();
    let csv = dir.join("frames.csv");
    let text = fs::read_to_string(&csv).unwrap();
    let without = |line: &str| match line.split_once(",masks/") {
        Some((kept, _)) => format!("{kept},"),
        None => line.to_owned(),
    };
    fs::write(&csv, text.lines().map(without).collect::<Vec<_>>().join("\n")).unwrap();
    let opened = Recording::open(&dir).unwrap();
    assert!(opened.frame(1).unwrap().instruments.count() > 0);
    assert_eq!(opened.mask_file_name(1), "000001.png");
    // Frames numbered from 1, without an index: each keeps its own mask.
    fs::remove_file(&csv).unwrap();
    for folder in ["color", "depth", "masks/instruments"] {
        for i in (0..3).rev() {
            let file = |i: usize| dir.join(format!("{folder}/{i:06}.png"));
            fs::rename(file(i), file(i + 1)).unwrap();
        }
    }
    assert_eq!(Recording::open(&dir).unwrap().mask_file_name(0), "000001.png");
}

#[test]
fn depth_of_another_camera_is_registered() {
    let (_root, dir) = recording();
    let toml = dir.join("recording.toml");
    let text = fs::read_to_string(&toml).unwrap();
    // The same camera, 20 mm to the left of the colour camera: at 0.3 m and 200 px that is 13.3 px.
    let motion = "[depth_to_color]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\ntranslation_m = [-0.02, 0, 0]\n";
    let camera = "[depth_camera]\nwidth = 160\nheight = 120\nfx = 200.0\nfy = 200.0\ncx = 79.5\ncy = 59.5\n";
    let (head, organs) = text.split_once("[[organ]]").unwrap();
    fs::write(&toml, format!("{head}{camera}{motion}\n[[organ]]{organs}")).unwrap();
    let plain = DepthImage::read(&dir.join("depth/000000.png"), 0.001).unwrap();
    let moved = Recording::open(&dir).unwrap().frame(0).unwrap().depth;
    assert!((plain.depth[10 * 160 + 100] - 0.3).abs() < 1e-6);
    assert!((0..120).all(|v| moved.depth[v * 160 + 159] == 0.0), "colour sees farther right than depth does");
    assert!((moved.depth[10 * 160 + 100 - 13] - 0.3).abs() < 1e-6);

    fs::write(&toml, format!("{head}{camera}\n[[organ]]{organs}")).unwrap();
    assert!(failure(&dir).contains("depth_camera needs depth_to_color"));
    let skewed = motion.replace("[1, 0, 0]", "[1, 0.2, 0]");
    fs::write(&toml, format!("{head}{camera}{skewed}\n[[organ]]{organs}")).unwrap();
    assert!(failure(&dir).contains("rotation is not a rotation"));
}

#[test]
fn an_unfinished_recording_leaves_nothing() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, &info(), 1);
    let before = fs::read(dir.join("frames.csv")).unwrap();
    let writer = RecordingWriter::create(&dir, &info()).unwrap();
    let (color, depth, _) = sphere::scene(&info().camera.unwrap());
    writer.frame(5, &color, &depth, None).unwrap();
    assert!(writer.frame(5, &color, &depth, None).is_err(), "a frame is written once");
    drop(writer);
    assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    assert_eq!(fs::read(dir.join("frames.csv")).unwrap(), before);
    let mut bad = info();
    bad.depth_scale_m = Some(0.0);
    assert!(RecordingWriter::create(&dir, &bad).err().unwrap().to_string().contains("depth_scale_m"));
}

#[test]
fn damaged_lifts_name_file_and_field() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    let mut info = info();
    info.lifts = vec![LiftInfo { rest: 0, first: 1, last: 2, click: [80.0, 60.0], force_n: None }];
    write(&dir, &info, 3);
    assert_eq!(Recording::open(&dir).unwrap().info.lifts, info.lifts);
    let toml = dir.join("recording.toml");
    let good = fs::read_to_string(&toml).unwrap();
    for (from, to, expected) in [
        ("last = 2", "last = 3", "lift[0].last is 3; the recording has the frames 0 to 2"),
        ("last = 2", "last = 1", "lift[0].last is 1; it must be after first"),
        ("rest = 0", "rest = 2", "lift[0].first is 1; it must not be before rest"),
        ("rest = 0", "rest = -1", "rest"),
        ("click = [80.0, 60.0]", "click = [80.0, 600.0]", "lift[0].click is [80, 600]"),
        ("click = [80.0, 60.0]", "click = [80.0]", "click"),
        ("click = [80.0, 60.0]", "klick = [80.0, 60.0]", "klick"),
    ] {
        fs::write(&toml, &good).unwrap();
        replace(&toml, from, to);
        let error = failure(&dir);
        assert!(error.contains("recording.toml") && error.contains(expected), "{error}");
    }
}
