//! Files of other writers are read as they were written.

#![allow(clippy::unwrap_used, reason = "a test")]

mod common;

use common::*;
use trocar_camera::{Camera, Distortion};
use trocar_recording::messages::{
    Encoding, MessageLog, decode_calibration, decode_float, decode_image, decode_transforms, find_rgbd_topics,
    read_one, realsense,
};

const CAMERA: Camera = Camera {
    width: W,
    height: H,
    fx: 20.5,
    fy: 21.5,
    cx: 7.25,
    cy: 5.75,
    distortion: Distortion([0.1, -0.05, 0.001, -0.002, 0.01, 0.0, 0.0, 0.0]),
};

fn first(log: &dyn MessageLog, t: usize) -> Vec<u8> {
    read_one(log, t, 0).unwrap()
}

/// Checks both streams: numbers, times, stamps and every pixel.
fn check_streams(log: &dyn MessageLog, color_topic: usize, depth_topic: usize) {
    assert_eq!(log.times(color_topic), (0..COLORS).map(|f| color_stamp(f) + LOG_DELAY).collect::<Vec<_>>());
    assert_eq!(log.times(depth_topic), (0..DEPTHS).map(|f| depth_stamp(f) + LOG_DELAY).collect::<Vec<_>>());
    for (f, image) in images(log, color_topic).iter().enumerate() {
        assert_eq!((image.stamp, pixels(image)), (color_stamp(f), &color(f)[..]));
    }
    for (f, image) in images(log, depth_topic).iter().enumerate() {
        assert_eq!((image.stamp, units(image)), (depth_stamp(f), &depth(f)[..]));
    }
}

#[test]
fn realsense_bags() {
    for (name, unit) in [("realsense.bag", None), ("realsense_bz2.bag", None), ("realsense_lz4.bag", Some(0.00025))] {
        let log = log(name);
        assert_eq!(log.problems(), [""; 0], "{name}");
        let found = realsense::find(log.topics()).unwrap();
        let guessed = find_rgbd_topics(&*log, None, None).unwrap();
        assert_eq!((guessed.color, guessed.depth, guessed.depth_units), (found.color, found.depth, found.depth_units));
        assert_eq!(log.topics()[found.color].name, "/device_0/sensor_1/Color_0/image/data");
        assert_eq!(log.topics()[found.depth_info.unwrap()].name, "/device_0/sensor_0/Depth_0/info/camera_info");
        assert_eq!(log.topics()[found.color_transform.unwrap()].name, "/device_0/sensor_1/Color_0/tf/0");
        check_streams(&*log, found.color, found.depth);
        assert_eq!(images(&*log, found.depth)[2].depth_unit, unit);

        let t = found.depth_units.unwrap();
        let expected = "/device_0/sensor_0/option/Depth Units/value";
        assert_eq!(
            log.topics()[t].name,
            if name.contains("bz2") { expected.replace("Depth ", "Depth_") } else { expected.to_owned() }
        );
        assert_eq!(decode_float(&log.topics()[t], &first(&*log, t)).unwrap(), 0.0001);
        assert_eq!(log.times(t), [1]);
        for t in [found.color_info.unwrap(), found.depth_info.unwrap()] {
            let camera = decode_calibration(&log.topics()[t], &first(&*log, t)).unwrap();
            assert_eq!(camera, Camera { distortion: Distortion::default(), ..CAMERA });
        }
        let transform = |t: usize| decode_transforms(&log.topics()[t], &first(&*log, t)).unwrap().remove(0);
        let (color, depth) = (transform(found.color_transform.unwrap()), transform(found.depth_transform.unwrap()));
        assert_eq!((color.translation, color.rotation), ([0.015, -0.001, 0.002], [0.0, 0.0, 0.6, 0.8]));
        let pose = realsense::color_from_depth(&color, &depth);
        let moved = pose.transform(glam::DVec3::new(1.0, 0.0, 0.0));
        // A rotation about z with cosine 0.28 and sine 0.96.
        assert!((moved - glam::DVec3::new(0.295, 0.959, 0.002)).length() < 1e-12, "{moved}");
        let undone = realsense::color_from_depth(&color, &color);
        assert!((undone.transform(moved) - moved).length() < 1e-12);
    }
}

#[test]
fn ros_mcap_files() {
    for name in ["ros1.mcap", "ros2_none.mcap", "ros2_zstd.mcap", "ros2_lz4.mcap", "ros2_big_endian_unchunked.mcap"] {
        let log = log(name);
        assert_eq!(log.problems(), [""; 0], "{name}");
        let guessed = find_rgbd_topics(&*log, None, None).unwrap();
        let named = |t: usize| log.topics()[t].name.as_str();
        assert_eq!(named(guessed.color), "/camera/color/image_raw");
        assert_eq!(named(guessed.depth), "/camera/aligned_depth_to_color/image_raw");
        assert_eq!(named(guessed.color_info.unwrap()), "/camera/color/camera_info");
        assert_eq!(named(guessed.depth_info.unwrap()), "/camera/aligned_depth_to_color/camera_info");
        let topic_ = &log.topics()[guessed.color];
        assert_eq!(topic_.kind, "sensor_msgs/Image");
        assert_eq!(topic_.count, COLORS);
        assert_eq!(topic_.encoding, if name == "ros1.mcap" { Encoding::Ros1 } else { Encoding::Cdr });
        check_streams(&*log, guessed.color, guessed.depth);

        let float = topic(&*log, "/camera/depth/image_rect_raw");
        for (f, image) in images(&*log, float).iter().enumerate() {
            assert_eq!((image.frame.as_str(), floats(image)), ("odd", &metres(f)[..]));
        }
        let t = guessed.color_info.unwrap();
        assert_eq!(decode_calibration(&log.topics()[t], &first(&*log, t)).unwrap(), CAMERA);
        let t = topic(&*log, "/camera/depth/camera_info");
        let rational = decode_calibration(&log.topics()[t], &first(&*log, t)).unwrap().distortion;
        assert_eq!(rational.0, [0.1, -0.05, 0.001, -0.002, 0.01, 0.02, 0.03, 0.04]);
        let t = guessed.transforms[0];
        let transforms = decode_transforms(&log.topics()[t], &first(&*log, t)).unwrap();
        let [one] = &transforms[..] else { panic!("{transforms:?}") };
        assert_eq!((one.stamp, one.parent.as_str(), one.child.as_str()), (START, "color_frame", "depth_frame"));
        assert_eq!((one.translation, one.rotation), ([0.1, 0.2, 0.3], [0.0, 0.0, 0.6, 0.8]));
    }
}

#[test]
fn foxglove_mcap_files() {
    for name in ["foxglove_protobuf.mcap", "foxglove_json.mcap"] {
        let log = log(name);
        assert_eq!(log.problems(), [""; 0], "{name}");
        let guessed = find_rgbd_topics(&*log, None, None).unwrap();
        check_streams(&*log, guessed.color, guessed.depth);
        let t = guessed.color_info.unwrap();
        assert_eq!(decode_calibration(&log.topics()[t], &first(&*log, t)).unwrap(), CAMERA);
        let t = guessed.transforms[0];
        let one = decode_transforms(&log.topics()[t], &first(&*log, t)).unwrap().remove(0);
        assert_eq!((one.stamp, one.parent.as_str(), one.child.as_str()), (START, "color_frame", "depth_frame"));
        assert_eq!((one.translation, one.rotation), ([0.1, 0.2, 0.3], [0.0, 0.0, 0.6, 0.8]));
    }
}

#[test]
fn compressed_images() {
    let log = log("compressed.bag");
    let lossless = topic(&*log, "/camera/lossless/compressed");
    check_streams(&*log, lossless, topic(&*log, "/camera/depth/image_raw/compressedDepth"));
    for (f, image) in images(&*log, topic(&*log, "/camera/color/image_raw/compressed")).iter().enumerate() {
        for (i, pixel) in pixels(image).iter().enumerate() {
            let (x, y) = (i % W, i / W);
            let smooth = [100 + 2 * x + f, 120 + 3 * y + f, 140 + x + y].map(|c| c as i32);
            assert!(pixel.iter().zip(smooth).all(|(&p, s)| (i32::from(p) - s).abs() <= 6), "{pixel:?} for {smooth:?}");
        }
    }
    for (f, image) in images(&*log, topic(&*log, "/float/depth/compressedDepth")).iter().enumerate() {
        assert_eq!(floats(image)[0], 0.0, "NaN is invalid");
        for (d, m) in floats(image).iter().zip(metres(f)).skip(1) {
            // A step of inverse depth is 1/10100 m^-1: about 0.03 mm at half a metre.
            assert!((d - m).abs() < 5e-5, "{d} for {m}");
        }
    }
    // Two colour topics, one named so; two depth topics, both named so.
    let message = find_rgbd_topics(&*log, None, None).unwrap_err().to_string();
    assert!(
        message.contains("several topics have depth") && message.contains("/float/depth/compressedDepth"),
        "{message}"
    );
}

#[test]
fn every_pixel_encoding() {
    let log = log("encodings.bag");
    let image = |name: &str| images(&*log, topic(&*log, name)).remove(0);
    for name in ["/rgb8", "/bgr8", "/8UC3", "/rgba8", "/bgra8"] {
        assert_eq!(pixels(&image(name)), color(1), "{name}");
    }
    let grey: Vec<[u8; 3]> = color(1).iter().map(|c| [c[0]; 3]).collect();
    assert_eq!(pixels(&image("/mono8")), grey);
    assert_eq!(pixels(&image("/8UC1")), grey);
    for name in ["/16UC1", "/mono16", "/z16"] {
        assert_eq!(units(&image(name)), depth(1), "{name}");
    }
    for name in ["/32FC1", "/32FC1_big"] {
        assert_eq!(floats(&image(name)), metres(1), "{name}");
    }
    for name in ["/yuv422", "/YUYV", "/yuv422_yuy2"] {
        for (p, c) in pixels(&image(name)).iter().zip(color(1)) {
            // BT.601 in real numbers: Cb 90, Cr 170.
            let luma = 1.164_383 * (f64::from(c[0]) - 16.0);
            let rgb = [luma + 1.596_027 * 42.0, luma + 0.391_762 * 38.0 - 0.812_968 * 42.0, luma - 2.017_232 * 38.0];
            assert!(
                p.iter().zip(rgb).all(|(&p, e)| (f64::from(p) - e.clamp(0.0, 255.0)).abs() <= 1.01),
                "{p:?} for {rgb:?}"
            );
        }
    }
}

/// A PNG of 70 bytes that claims 16000 x 16000 pixels, and one that is too large on a side.
#[test]
fn images_larger_than_their_file_are_refused() {
    let log = log("compressed.bag");
    let t = topic(&*log, "/camera/lossless/compressed");
    let message = first(&*log, t);
    let png = message.windows(4).position(|w| w == b"\x89PNG").unwrap();
    for (side, expected) in [(16_000u32, "too few"), (20_000, "at most 16384")] {
        let mut message = message.clone();
        let header = &mut message[png + 12..png + 33];
        header[4..8].copy_from_slice(&side.to_be_bytes());
        header[8..12].copy_from_slice(&side.to_be_bytes());
        let crc = crc32fast::hash(&header[..17]);
        header[17..].copy_from_slice(&crc.to_be_bytes());
        let error = decode_image(&log.topics()[t], &message).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn messages_come_in_the_order_of_the_file() {
    let log = log("realsense_lz4.bag");
    let found = realsense::find(log.topics()).unwrap();
    let wanted = [(found.depth, 4), (found.color, 0), (found.depth, 0), (found.color, 99), (77, 0), (found.color, 0)];
    let order: Vec<_> = log.messages(&wanted).map(|m| (m.topic, m.index, m.bytes.is_ok())).collect();
    let (color, depth) = (found.color, found.depth);
    assert_eq!(order[..4], [(color, 0, true), (color, 0, true), (depth, 0, true), (depth, 4, true)]);
    assert_eq!(order.len(), 6);
    assert!(order[4..].iter().all(|o| !o.2));
    assert_eq!(log.times(77), [0; 0]);
}

#[test]
fn wrong_types_and_files_are_named() {
    let log = log("realsense.bag");
    let found = realsense::find(log.topics()).unwrap();
    let topic = &log.topics()[found.depth_units.unwrap()];
    let message = decode_image(topic, &[0; 4]).unwrap_err().to_string();
    assert!(message.contains("Depth Units") && message.contains("std_msgs/Float32"), "{message}");
    let message = decode_float(topic, &[0; 3]).unwrap_err().to_string();
    assert!(message.contains("cut short"), "{message}");
    let folder = tempfile::tempdir().unwrap();
    for content in [&b""[..], b"#ROSBAG V1.2\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n", b"\x89PNG"] {
        let path = folder.path().join("a.bag");
        std::fs::write(&path, content).unwrap();
        let Err(error) = trocar_recording::messages::open(&path) else { panic!("{content:?} was opened") };
        assert!(error.to_string().contains("a.bag"), "{error}");
    }
    assert!(trocar_recording::messages::open(&folder.path().join("none.bag")).is_err());
}
