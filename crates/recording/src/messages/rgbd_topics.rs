//! Finds the topics of the colour and the depth camera.
//!
//! A RealSense bag names them. In other logs the first message of every image topic is decoded,
//! which separates colour from depth. Names decide between several topics: depth aligned to colour
//! before other depth, "color" or "rgb" before other images, and uncompressed before compressed
//! images of the same camera. Infrared images are ignored.

use super::decode::decode_image;
use super::error::{Error, Result};
use super::image::Image;
use super::realsense;
use super::topic::{MessageLog, Topic, read_one};

/// Indices of the topics of an RGB-D recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbdTopics {
    /// Colour images.
    pub color: usize,
    /// Depth images.
    pub depth: usize,
    /// Calibration of the colour camera.
    pub color_info: Option<usize>,
    /// Calibration of the depth camera; that of colour when depth is aligned to it.
    pub depth_info: Option<usize>,
    /// Unit of depth (RealSense); without it, units are millimetres (REP 118).
    pub depth_units: Option<usize>,
    /// Transform from the reference to the colour stream's frame (RealSense).
    pub color_transform: Option<usize>,
    /// Transform from the reference to the depth stream's frame (RealSense).
    pub depth_transform: Option<usize>,
    /// All topics of transforms between named frames.
    pub transforms: Vec<usize>,
}

/// Finds the topics of an RGB-D recording. `color` and `depth` name topics that the user chose.
///
/// # Errors
/// [`Error::Choice`] when there is no colour or no depth, when several topics are equally good, or
/// when a named topic does not exist. The error lists the topics.
pub fn find_rgbd_topics(log: &dyn MessageLog, color: Option<&str>, depth: Option<&str>) -> Result<RgbdTopics> {
    let topics = log.topics();
    let transforms = (0..topics.len()).filter(|&t| is_transforms(&topics[t])).collect();
    let named = |name: &str| {
        let found = topics.iter().position(|t| t.name == name);
        found.ok_or_else(|| choice(log, &format!("no topic '{name}'")))
    };
    let (color, depth) = (color.map(named).transpose()?, depth.map(named).transpose()?);
    // A user may name the RealSense streams themselves: units and transforms still belong to them.
    let chosen = |named: Option<usize>, found: usize| named.is_none_or(|t| t == found);
    if let Some(found) = realsense::find(topics).filter(|f| chosen(color, f.color) && chosen(depth, f.depth)) {
        return Ok(RgbdTopics {
            color: found.color,
            depth: found.depth,
            color_info: found.color_info,
            depth_info: found.depth_info,
            depth_units: found.depth_units,
            color_transform: found.color_transform,
            depth_transform: found.depth_transform,
            transforms,
        });
    }
    let images: Vec<(usize, bool)> = (0..topics.len()).filter_map(|t| Some((t, is_depth(log, t)?))).collect();
    let best = |depth: bool| {
        let of_kind: Vec<usize> = images.iter().filter(|i| i.1 == depth).map(|i| i.0).collect();
        let rank = |&t: &usize| rank(&topics[t], depth);
        let top = of_kind.iter().map(rank).max();
        of_kind.iter().copied().filter(|t| Some(rank(t)) == top).collect::<Vec<usize>>()
    };
    let one = |what: &str, depth: bool, named: Option<usize>| match (named, &best(depth)[..]) {
        (Some(t), _) => Ok(t),
        (None, [t]) => Ok(*t),
        (None, []) => Err(choice(log, &format!("there are no {what} images"))),
        (None, _) => Err(choice(log, &format!("several topics have {what} images"))),
    };
    let (color, depth) = (one("colour", false, color)?, one("depth", true, depth)?);
    let color_info = info(topics, color);
    let depth_info = info(topics, depth).or_else(|| color_info.filter(|_| is_aligned(&topics[depth].name)));
    Ok(RgbdTopics {
        color,
        depth,
        color_info,
        depth_info,
        depth_units: None,
        color_transform: None,
        depth_transform: None,
        transforms,
    })
}

fn is_transforms(topic: &Topic) -> bool {
    const KINDS: [&str; 5] = [
        "tf2_msgs/TFMessage",
        "tf/tfMessage",
        "geometry_msgs/TransformStamped",
        "foxglove.FrameTransform",
        "foxglove.FrameTransforms",
    ];
    KINDS.contains(&topic.kind.as_str())
}

/// A topic's name without the suffix of the image transport.
fn camera(name: &str) -> &str {
    ["/compressed", "/compressedDepth"].iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name)
}

/// Whether a topic's images are depth images; `None` for other messages and infrared images.
fn is_depth(log: &dyn MessageLog, t: usize) -> Option<bool> {
    const KINDS: [&str; 4] =
        ["sensor_msgs/Image", "sensor_msgs/CompressedImage", "foxglove.RawImage", "foxglove.CompressedImage"];
    let topic = &log.topics()[t];
    let name = camera(&topic.name).to_ascii_lowercase();
    if !KINDS.contains(&topic.kind.as_str()) || name.contains("infra") || name.split('/').any(|part| part == "ir") {
        return None;
    }
    match read_one(log, t, 0).and_then(|bytes| decode_image(topic, &bytes)) {
        Ok(image) => Some(matches!(image.image, Image::Depth(_))),
        Err(_) => Some(name.contains("depth")),
    }
}

fn is_aligned(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.contains("aligned") || name.contains("registered") || name.contains("depth_to_color")
}

/// Rank of a topic; the highest is used.
fn rank(topic: &Topic, depth: bool) -> (u8, u8) {
    let name = camera(&topic.name).to_ascii_lowercase();
    let named = if depth {
        u8::from(name.contains("depth")) + 2 * u8::from(is_aligned(&name))
    } else if ["color", "colour", "rgb"].iter().any(|c| name.contains(c)) {
        2
    } else {
        u8::from(name.contains("image"))
    };
    (named, u8::from(!topic.kind.ends_with("CompressedImage")))
}

/// The only calibration that shares the most leading parts of its name (at least one) with an image
/// topic.
fn info(topics: &[Topic], image: usize) -> Option<usize> {
    let parts = |t: usize| topics[t].name.split('/').filter(|p| !p.is_empty());
    let shared = |t: usize| parts(t).zip(parts(image)).take_while(|(a, b)| a == b).count();
    let kinds = ["sensor_msgs/CameraInfo", "foxglove.CameraCalibration"];
    let infos: Vec<usize> = (0..topics.len()).filter(|&t| kinds.contains(&topics[t].kind.as_str())).collect();
    let most = infos.iter().map(|&t| shared(t)).max().filter(|&n| n > 0)?;
    let mut best = infos.into_iter().filter(|&t| shared(t) == most);
    let first = best.next();
    first.filter(|_| best.next().is_none())
}

fn choice(log: &dyn MessageLog, what: &str) -> Error {
    let list: Vec<String> =
        log.topics().iter().map(|t| format!("{} ({}, {} messages)", t.name, t.kind, t.count)).collect();
    let list =
        if list.is_empty() { "there are no topics".into() } else { format!("the topics are {}", list.join(", ")) };
    Error::Choice {
        path: log.path().to_owned(),
        reason: format!("{what}; name them as color_topic and depth_topic under [source]; {list}"),
    }
}
