//! Bags and MCAP files of other writers open as recordings.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};
use trocar_recording::Recording;

/// A fixture (16 x 12 pixels, 4 colour and 5 depth images; colour f has red 10 x + f, depth f has
/// 400 + 3 x + 5 y + f units), copied into a folder of its own.
fn fixture(name: &str) -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    let to = root.path().join(name);
    fs::copy(from, &to).unwrap();
    (root, to)
}

#[test]
fn every_kind_of_log_gives_the_same_frames() {
    let aligned = ["ros1.mcap", "ros2_none.mcap", "ros2_zstd.mcap", "ros2_lz4.mcap", "ros2_big_endian_unchunked.mcap"];
    for name in aligned {
        let (_root, path) = fixture(name);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.len(), 4, "{name}");
        assert!(recording.registration().is_none(), "{name}: aligned depth stays where it is");
        assert!(recording.notes()[0].contains("0 colour and 1 depth"), "{name}: {:?}", recording.notes());
        assert_eq!((recording.camera().fx, recording.camera().cy), (20.5, 5.75));
        assert_eq!(recording.depth_scale(), 0.001);
        let mut frames: Vec<usize> = Vec::new();
        for packet in recording.packets(&[1, 3]) {
            let frame = recording.decode(packet.frame, &packet.parts.unwrap()).unwrap();
            frames.push(packet.frame);
            let (x, y) = (5, 7);
            assert_eq!(frame.color.pixels[y * 16 + x][0] as usize, 10 * x + packet.frame);
            let depth = 1e-3 * (400 + 3 * x + 5 * y + packet.frame) as f64;
            assert!((f64::from(frame.depth.depth[y * 16 + x]) - depth).abs() < 1e-6);
            assert_eq!(frame.depth.depth[0], 0.0);
        }
        frames.sort_unstable();
        assert_eq!(frames, [1, 3], "{name}");
    }
}

#[test]
fn realsense_bags_register_depth_by_their_own_extrinsics() {
    for name in ["realsense.bag", "realsense_bz2.bag", "realsense_lz4.bag"] {
        let (_root, path) = fixture(name);
        let recording = Recording::open(&path).unwrap();
        assert_eq!((recording.len(), recording.depth_scale()), (4, 0.0001), "{name}");
        let registration = recording.registration().expect("its cameras stand apart");
        // The colour stream's transform rotates by sine 0.28, cosine 0.96 about z, the depth
        // stream's by nothing.
        assert!(
            (registration.rotation.x_axis.x - 0.28).abs() < 1e-9
                && (registration.rotation.x_axis.y - 0.96).abs() < 1e-9
        );
        assert!((registration.translation.x - 0.015).abs() < 1e-9);
        assert!(recording.frame(2).is_ok());
        // Naming the log's own topics changes nothing.
        let topics = "color_topic = \"/device_0/sensor_1/Color_0/image/data\"\ndepth_topic = \"/device_0/sensor_0/Depth_0/image/data\"";
        let said = format!("name = \"x\"\nup = [0, 0, -1]\n[source]\nfile = \"{name}\"\n{topics}\n");
        fs::write(path.with_extension("toml"), said).unwrap();
        let named = Recording::open(&path).unwrap();
        assert_eq!((named.depth_scale(), named.registration()), (recording.depth_scale(), recording.registration()));
        assert!(recording.describe().iter().any(|t| t.contains("Depth_0/image/data") && t.contains("used as depth")));
    }
}

#[test]
fn the_users_facts_override_the_log() {
    let (_root, path) = fixture("ros2_none.mcap");
    let toml = path.with_extension("toml");
    let said = "name = \"x\"\nup = [0, 0, -1]\ndepth_scale_m = 0.0005\n";
    let camera = "[camera]\nwidth = 16\nheight = 12\nfx = 30.0\nfy = 30.0\ncx = 8.0\ncy = 6.0\n";
    fs::write(&toml, format!("{said}{camera}")).unwrap();
    let error = Recording::open(&path).unwrap_err().to_string();
    assert!(error.contains("[depth_to_color]"), "the log's depth camera is not this one: {error}");
    fs::write(&toml, format!("{said}{camera}{}", camera.replace("[camera]", "[depth_camera]"))).unwrap();
    let error = Recording::open(&path).unwrap_err().to_string();
    assert!(error.contains("depth_camera needs depth_to_color"), "{error}");
    fs::write(&toml, said).unwrap();
    assert_eq!(Recording::open(&path).unwrap().depth_scale(), 0.0005);

    for (topics, expected) in [
        (
            "color_topic = \"/nowhere\"",
            "no topic '/nowhere'; name them as color_topic and depth_topic under [source]; the topics are",
        ),
        ("depth_topic = \"/camera/color/image_raw\"", "swapped?"),
        ("colour_topic = \"/camera\"", "did you mean `color_topic`?"),
    ] {
        fs::write(&toml, format!("{said}[source]\nfile = \"ros2_none.mcap\"\n{topics}\n")).unwrap();
        let error = Recording::open(&path).unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains('\n'), "{topics}: {error}");
    }
    fs::write(&toml, format!("{said}[source]\nfile = \"other.mcap\"\n")).unwrap();
    assert!(Recording::open(&path).unwrap_err().to_string().contains("it must be 'ros2_none.mcap', the log beside it"));
}

#[test]
fn a_folder_may_name_its_log() {
    let (root, path) = fixture("foxglove_json.mcap");
    let file = path.file_name().unwrap().to_str().unwrap();
    let text = format!("name = \"x\"\nup = [0, 0, -1]\n[source]\nfile = \"{file}\"\n");
    fs::write(root.path().join("recording.toml"), text.replace("foxglove_json", "../foxglove_json")).unwrap();
    assert!(Recording::open(root.path()).unwrap_err().to_string().contains("without '..'"));
    fs::write(root.path().join("recording.toml"), text).unwrap();
    let recording = Recording::open(root.path()).unwrap();
    assert!(recording.len() >= 4, "{}", recording.len());
}

#[test]
fn a_cut_log_is_used_as_far_as_it_goes() {
    let (_root, path) = fixture("realsense.bag");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() * 6 / 10]).unwrap();
    let recording = Recording::open(&path).unwrap();
    assert!((1..4).contains(&recording.len()), "{}", recording.len());
    assert!(!recording.notes().is_empty());
    fs::write(&path, b"not a bag").unwrap();
    let error = Recording::open(&path).unwrap_err().to_string();
    assert!(error.contains("realsense.bag") && error.contains("neither a ROS 1 bag nor an MCAP"), "{error}");
}
