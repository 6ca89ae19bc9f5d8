//! The contents that `make_fixtures.py` writes, by the same formulas.

#![allow(dead_code, reason = "every test file uses a part")]
#![allow(clippy::unwrap_used, reason = "a helper of tests")]

use std::path::{Path, PathBuf};
use trocar_recording::messages::{
    DepthValues, Image, MessageLog, StampedImage, Topic, decode_calibration, decode_float, decode_image,
    decode_transforms, open,
};

pub const W: usize = 16;
pub const H: usize = 12;
pub const COLORS: usize = 4;
pub const DEPTHS: usize = 5;
pub const START: u64 = 1_700_000_000_000_000_000;
const PERIOD: u64 = 33_333_333;
pub const LOG_DELAY: u64 = 5_000_000;

/// All fixtures.
pub const ALL: [&str; 12] = [
    "realsense.bag",
    "realsense_bz2.bag",
    "realsense_lz4.bag",
    "compressed.bag",
    "encodings.bag",
    "ros1.mcap",
    "ros2_none.mcap",
    "ros2_zstd.mcap",
    "ros2_lz4.mcap",
    "ros2_big_endian_unchunked.mcap",
    "foxglove_protobuf.mcap",
    "foxglove_json.mcap",
];

pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

pub fn log(name: &str) -> Box<dyn MessageLog> {
    open(&fixture(name)).unwrap()
}

pub fn color_stamp(f: usize) -> u64 {
    START + f as u64 * PERIOD
}

pub fn depth_stamp(f: usize) -> u64 {
    color_stamp(f) + 1_000_000
}

fn grid<T>(value: impl Fn(usize, usize) -> T) -> Vec<T> {
    (0..H).flat_map(|y| (0..W).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect()
}

pub fn color(f: usize) -> Vec<[u8; 3]> {
    grid(|x, y| [x * 10 + f, y * 20 + f, x * y + 7 * f].map(|c| c as u8))
}

pub fn depth(f: usize) -> Vec<u16> {
    grid(|x, y| if x + y == 0 { 0 } else { (400 + 3 * x + 5 * y + f) as u16 })
}

pub fn metres(f: usize) -> Vec<f32> {
    depth(f).iter().map(|&d| f32::from(d) / 1000.0).collect()
}

pub fn topic(log: &dyn MessageLog, name: &str) -> usize {
    log.topics().iter().position(|t| t.name == name).unwrap_or_else(|| panic!("no {name} in {:?}", log.topics()))
}

/// All images of a topic, in the order of their times.
pub fn images(log: &dyn MessageLog, t: usize) -> Vec<StampedImage> {
    let wanted: Vec<_> = (0..log.times(t).len()).map(|i| (t, i)).collect();
    let mut found: Vec<_> = log.messages(&wanted).collect();
    found.sort_by_key(|m| m.index);
    found.iter().map(|m| decode_image(&log.topics()[t], m.bytes.as_ref().unwrap()).unwrap()).collect()
}

pub fn pixels(image: &StampedImage) -> &[[u8; 3]] {
    match &image.image {
        Image::Color(c) if (c.width, c.height) == (W, H) => &c.pixels,
        other => panic!("{other:?}"),
    }
}

pub fn units(image: &StampedImage) -> &[u16] {
    match &image.image {
        Image::Depth(d) if (d.width, d.height) == (W, H) => match &d.values {
            DepthValues::Units(units) => units,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    }
}

pub fn floats(image: &StampedImage) -> &[f32] {
    match &image.image {
        Image::Depth(d) if (d.width, d.height) == (W, H) => match &d.values {
            DepthValues::Metres(metres) => metres,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    }
}

/// Decodes every message of a log in every way. Returns how many messages were read, and how many
/// decoded as something.
pub fn read_all(log: &dyn MessageLog) -> (usize, usize) {
    let wanted: Vec<_> = (0..log.topics().len()).flat_map(|t| (0..log.times(t).len()).map(move |i| (t, i))).collect();
    let (mut had, mut decoded) = (0, 0);
    for message in log.messages(&wanted) {
        let Ok(bytes) = message.bytes else { continue };
        had += 1;
        decoded += usize::from(decode_all(&log.topics()[message.topic], &bytes));
    }
    (had, decoded)
}

/// Decodes a message in every way; returns whether one of them succeeds.
pub fn decode_all(topic: &Topic, bytes: &[u8]) -> bool {
    let image = decode_image(topic, bytes);
    if let Ok(StampedImage { image: Image::Depth(depth), .. }) = &image {
        assert_eq!(depth.to_metres(0.001).depth.len(), depth.width * depth.height);
    }
    if let Ok(StampedImage { image: Image::Color(color), .. }) = &image {
        assert_eq!(color.pixels.len(), color.width * color.height);
    }
    let any = [
        image.is_ok(),
        decode_calibration(topic, bytes).is_ok(),
        decode_float(topic, bytes).is_ok(),
        decode_transforms(topic, bytes).is_ok(),
    ];
    any.contains(&true)
}
