//! Frames from a log file: a RealSense bag, any other ROS 1 bag, or MCAP.

use crate::error::{Error, Result};
use crate::info::{DepthToColor, SourceInfo};
use crate::messages::{
    self, DepthValues, Image, MessageLog, RgbdTopics, decode_calibration, decode_float, decode_image,
    decode_transforms, read_one, realsense,
};
use crate::pairing::Pairing;
use crate::source::{FrameSource, Images, Packet, Parts};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, Mask};
use trocar_core::Pose;

/// Unit of 16-bit depth where the log has none (ROS REP 118) (m).
const MILLIMETRE: f64 = 1e-3;
/// Unit in which depth in floating-point metres is kept (m); it holds up to 6.5 m.
const FLOAT_UNIT: f64 = 1e-4;
/// Messages of a transform topic that are read: those between fixed frames come first and repeat.
const TRANSFORMS: usize = 200;

/// The colour and depth images of a log file, paired by time.
pub struct Log {
    log: Box<dyn MessageLog>,
    color: usize,
    depth: usize,
    /// (colour, depth): indices of messages.
    pairs: Vec<(usize, usize)>,
    depth_scale_m: f64,
    /// `masks/instruments` of its folder, with a mask `000012.png` for frame 12.
    instruments: PathBuf,
    notes: Vec<String>,
}

/// The cameras that a log file describes.
#[derive(Clone, Debug, Default)]
pub struct LogCameras {
    /// Colour.
    pub color: Option<Camera>,
    /// Depth.
    pub depth: Option<Camera>,
    /// From the depth camera's frame to the colour camera's.
    pub depth_to_color: Option<DepthToColor>,
    /// Unit of depth (m).
    pub depth_scale_m: f64,
}

impl Log {
    /// Opens the log `source` of the folder `dir`. `depth_scale_m` (m) overrides the log's unit of
    /// depth.
    pub fn open(dir: &Path, source: &SourceInfo, depth_scale_m: Option<f64>) -> Result<(Self, LogCameras)> {
        let path = dir.join(&source.file);
        let log = messages::open(&path)?;
        let found = messages::find_rgbd_topics(&*log, source.color_topic.as_deref(), source.depth_topic.as_deref());
        // In a damaged file, a missing topic may be among the lost data.
        let found = found.map_err(|e| match (e, log.problems().first()) {
            (messages::Error::Choice { reason, .. }, Some(problem)) => {
                Error::wrong(&path, format!("{problem}; {reason}"))
            }
            (e, _) => e.into(),
        })?;
        let mut cameras = cameras(&*log, &found);
        let said = cameras.depth_scale_m;
        cameras.depth_scale_m = depth_scale_m.unwrap_or(said);
        let seconds = |topic: usize| -> Vec<f64> { log.times(topic).iter().map(|t| 1e-9 * *t as f64).collect() };
        let pairing = Pairing::by_time(&seconds(found.color), &seconds(found.depth));
        let mut notes = log.problems().to_vec();
        notes.extend(pairing.notes());
        if (cameras.depth_scale_m / said - 1.0).abs() > 1e-6 {
            let given = cameras.depth_scale_m;
            notes.push(format!("depth_scale_m = {given} overrides the file's {said}."));
        }
        if pairing.pairs.is_empty() {
            let name = |t: usize| &log.topics()[t].name;
            let reason =
                format!("no image of {} was taken at the time of an image of {}", name(found.color), name(found.depth));
            return Err(Error::wrong(&path, reason));
        }
        let depth_scale_m = cameras.depth_scale_m;
        let instruments = dir.join("masks/instruments");
        let log = Self {
            log,
            color: found.color,
            depth: found.depth,
            pairs: pairing.pairs,
            depth_scale_m,
            instruments,
            notes,
        };
        Ok((log, cameras))
    }

    fn mask_file(&self, frame: usize) -> PathBuf {
        self.instruments.join(format!("{}.png", self.mask_stem(frame)))
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Log({}, {} frames)", self.log.path().display(), self.pairs.len())
    }
}

impl FrameSource for Log {
    fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Colour and depth of a frame are apart in the file: the first waits for the second.
    fn packets<'a>(&'a self, wanted: &[usize]) -> Box<dyn Iterator<Item = Packet> + Send + 'a> {
        let wanted: Vec<usize> = wanted.iter().copied().filter(|i| *i < self.pairs.len()).collect();
        let mut messages = Vec::with_capacity(2 * wanted.len());
        let mut frame_of = BTreeMap::new();
        for &frame in &wanted {
            let (color, depth) = self.pairs[frame];
            for key in [(self.color, color), (self.depth, depth)] {
                messages.push(key);
                frame_of.insert(key, frame);
            }
        }
        let mut waiting: BTreeMap<usize, Result<Vec<u8>>> = BTreeMap::new();
        let packets = self.log.messages(&messages).filter_map(move |message| {
            let frame = *frame_of.get(&(message.topic, message.index))?;
            let is_color = message.topic == self.color;
            let bytes = message.bytes.map_err(Error::from);
            let Some(other) = waiting.remove(&frame) else {
                waiting.insert(frame, bytes);
                return None;
            };
            let parts = match if is_color { (bytes, other) } else { (other, bytes) } {
                (Ok(color), Ok(depth)) => {
                    // A frame without a mask shows no instrument.
                    let path = self.mask_file(frame);
                    match std::fs::read(&path) {
                        Ok(mask) => Ok(Parts { color: Some(color), depth, instruments: Some(mask) }),
                        Err(e) if e.kind() == ErrorKind::NotFound => {
                            Ok(Parts { color: Some(color), depth, instruments: None })
                        }
                        Err(e) => Err(Error::io(&path)(e)),
                    }
                }
                (Err(e), _) | (_, Err(e)) => Err(e),
            };
            Some(Packet { frame, parts })
        });
        Box::new(packets)
    }

    fn decode(&self, frame: usize, parts: &Parts) -> Result<Images> {
        let topics = self.log.topics();
        let wrong = |what: &str, topic: usize| {
            let name = &topics[topic].name;
            let swapped = "are color_topic and depth_topic swapped?";
            Err(Error::wrong(self.log.path(), format!("frame {frame}: {name} holds no {what} images; {swapped}")))
        };
        let color = match &parts.color {
            Some(bytes) => match decode_image(&topics[self.color], bytes)?.image {
                Image::Color(image) => Some(image),
                Image::Depth(_) => return wrong("colour", self.color),
            },
            None => None,
        };
        match decode_image(&topics[self.depth], &parts.depth)?.image {
            Image::Depth(depth) => {
                let decode = |bytes: &Vec<u8>| Mask::decode(bytes, &self.mask_file(frame));
                let instruments = parts.instruments.as_ref().map(decode).transpose()?;
                Ok(Images { color, depth: depth.to_metres(self.depth_scale_m), instruments })
            }
            Image::Color(_) => wrong("depth", self.depth),
        }
    }

    fn name(&self, index: usize) -> String {
        let (_, depth) = self.pairs[index];
        let times = self.log.times(self.depth);
        let start = times.first().copied().unwrap_or(0);
        let seconds = 1e-9 * times.get(depth).map_or(0, |t| t - start) as f64;
        format!("{}: frame {index} at {seconds:.3} s", self.log.path().display())
    }

    fn mask_stem(&self, index: usize) -> String {
        format!("{index:06}")
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn describe(&self) -> Vec<String> {
        let used = |t: usize| match t {
            _ if t == self.color => ", used as colour",
            _ if t == self.depth => ", used as depth",
            _ => "",
        };
        let topics = self.log.topics().iter().enumerate();
        topics.map(|(i, t)| format!("{} ({}, {} messages{})", t.name, t.kind, t.count, used(i))).collect()
    }
}

/// Reads the log's cameras. Missing or invalid ones are left out; the caller asks for them.
fn cameras(log: &dyn MessageLog, found: &RgbdTopics) -> LogCameras {
    let topics = log.topics();
    let first = |t: usize| Some((&topics[t], read_one(log, t, 0).ok()?));
    let camera = |t: usize| first(t).and_then(|(topic, bytes)| decode_calibration(topic, &bytes).ok());
    let image = |t: usize| first(t).and_then(|(topic, bytes)| decode_image(topic, &bytes).ok());
    let depth = image(found.depth);
    let float = depth
        .as_ref()
        .is_some_and(|d| matches!(&d.image, Image::Depth(d) if matches!(d.values, DepthValues::Metres(_))));
    let said = found.depth_units.and_then(first).and_then(|(topic, bytes)| decode_float(topic, &bytes).ok());
    let said = said.or(depth.as_ref().and_then(|d| d.depth_unit)).map(f64::from).filter(|s| (1e-6..=0.1).contains(s));
    let transform =
        |t: usize| first(t).and_then(|(topic, bytes)| decode_transforms(topic, &bytes).ok()?.into_iter().next());
    let pose = match (found.color_transform.and_then(transform), found.depth_transform.and_then(transform)) {
        (Some(color), Some(depth)) => Some(realsense::color_from_depth(&color, &depth)),
        _ => image(found.color).zip(depth).and_then(|(color, depth)| between(log, found, &color.frame, &depth.frame)),
    };
    LogCameras {
        color: found.color_info.and_then(camera),
        depth: found.depth_info.and_then(camera),
        depth_to_color: pose.map(|pose| DepthToColor {
            rotation: glam::DMat3::from_quat(pose.rotation).transpose().to_cols_array_2d(),
            translation_m: pose.translation.into(),
        }),
        // Rounds 32-bit floats to the intended number: 0.001, not 0.0010000000474974513.
        depth_scale_m: if float { FLOAT_UNIT } else { said.map_or(MILLIMETRE, |s| (s * 1e9).round() / 1e9) },
    }
}

/// The transform from the frame of depth to that of colour, along the log's transforms.
fn between(log: &dyn MessageLog, found: &RgbdTopics, color: &str, depth: &str) -> Option<Pose> {
    if color.is_empty() || color == depth {
        return None;
    }
    // Child frame to parent frame; the first message about a child counts.
    let mut parents: BTreeMap<String, (String, Pose)> = BTreeMap::new();
    for &topic in &found.transforms {
        let wanted: Vec<(usize, usize)> = (0..log.topics()[topic].count.min(TRANSFORMS)).map(|i| (topic, i)).collect();
        for bytes in log.messages(&wanted).filter_map(|m| m.bytes.ok()) {
            for t in decode_transforms(&log.topics()[topic], &bytes).unwrap_or_default() {
                let pose = t.pose();
                parents.entry(t.child).or_insert((t.parent, pose));
            }
        }
    }
    // Every ancestor of a frame, and the transform to it.
    let ancestors = |frame: &str| {
        let mut ways = vec![(frame.to_owned(), Pose::IDENTITY)];
        while let Some((parent, pose)) = ways.last().and_then(|(frame, _)| parents.get(frame)) {
            let Some((_, so_far)) = ways.last() else { break };
            if ways.iter().any(|(frame, _)| frame == parent) {
                break;
            }
            let way =
                Pose { rotation: pose.rotation * so_far.rotation, translation: pose.transform(so_far.translation) };
            ways.push((parent.clone(), way));
        }
        ways
    };
    let from_color = ancestors(color);
    let (up, down) = ancestors(depth)
        .into_iter()
        .find_map(|(frame, up)| Some((up, from_color.iter().find(|(f, _)| *f == frame)?.1)))?;
    let back = down.inverse();
    Some(Pose { rotation: back.rotation * up.rotation, translation: back.transform(up.translation) })
}
