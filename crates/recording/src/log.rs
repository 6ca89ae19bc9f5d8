//! Frames from a log file: a RealSense bag, any other ROS 1 bag, or MCAP.

use crate::pairing::Pairing;
use crate::source::{FrameSource, Images, Packet, Parts};
use crate::{DepthToColor, Error, Result, SourceInfo};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, Mask};
use trocar_core::Pose;
use trocar_messages::{
    DepthValues, Guess, Image, MessageLog, decode_calibration, decode_float, decode_image, decode_transforms, read_one,
    realsense,
};

/// Unit of 16-bit depth where the log does not say (ROS REP 118) [m].
const MILLIMETRE: f64 = 1e-3;
/// Depth in floating-point metres is kept in this unit [m]: up to 6.5 m.
const FLOAT_UNIT: f64 = 1e-4;
/// Messages of a topic of transforms that are looked at: those between fixed frames come first and again and again.
const TRANSFORMS: usize = 200;

/// The colour and depth images of a log file, paired by their times.
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

/// What a log file says of its cameras.
#[derive(Clone, Debug, Default)]
pub struct LogCameras {
    /// Colour.
    pub color: Option<Camera>,
    /// Depth.
    pub depth: Option<Camera>,
    /// Between the two.
    pub depth_to_color: Option<DepthToColor>,
    /// Metres a unit of depth.
    pub depth_scale_m: f64,
}

impl Log {
    /// Opens the log `source` of the folder `dir`. `depth_scale_m` overrules what the log says of its unit.
    ///
    /// # Errors
    /// Names the file, and the topics when colour and depth are not to be found among them.
    pub fn open(dir: &Path, source: &SourceInfo, depth_scale_m: Option<f64>) -> Result<(Self, LogCameras)> {
        let path = dir.join(&source.file);
        let log = trocar_messages::open(&path)?;
        let guess = trocar_messages::guess(&*log, source.color_topic.as_deref(), source.depth_topic.as_deref());
        // In a damaged file what is missing may be what was lost.
        let guess = guess.map_err(|e| match (e, log.problems().first()) {
            (trocar_messages::Error::Choice { reason, .. }, Some(problem)) => {
                Error::wrong(&path, format!("{problem}; {reason}"))
            }
            (e, _) => e.into(),
        })?;
        let mut cameras = cameras(&*log, &guess);
        let said = cameras.depth_scale_m;
        cameras.depth_scale_m = depth_scale_m.unwrap_or(said);
        let seconds = |topic: usize| -> Vec<f64> { log.times(topic).iter().map(|t| 1e-9 * *t as f64).collect() };
        let pairing = Pairing::by_time(&seconds(guess.color), &seconds(guess.depth));
        let mut notes = log.problems().to_vec();
        notes.extend(pairing.notes());
        if (cameras.depth_scale_m / said - 1.0).abs() > 1e-6 {
            let given = cameras.depth_scale_m;
            notes.push(format!("depth_scale_m = {given} is used, although the file says {said}."));
        }
        if pairing.pairs.is_empty() {
            let name = |t: usize| &log.topics()[t].name;
            let reason =
                format!("no image of {} was taken at the time of one of {}", name(guess.color), name(guess.depth));
            return Err(Error::wrong(&path, reason));
        }
        let depth_scale_m = cameras.depth_scale_m;
        let instruments = dir.join("masks/instruments");
        let log = Self {
            log,
            color: guess.color,
            depth: guess.depth,
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

    /// Colour and depth of a frame lie apart in the file: the earlier one waits for the other.
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

/// What the log says of its cameras; what it does not say, or says wrongly, is left out and asked for later.
fn cameras(log: &dyn MessageLog, guess: &Guess) -> LogCameras {
    let topics = log.topics();
    let first = |t: usize| Some((&topics[t], read_one(log, t, 0).ok()?));
    let camera = |t: usize| first(t).and_then(|(topic, bytes)| decode_calibration(topic, &bytes).ok());
    let image = |t: usize| first(t).and_then(|(topic, bytes)| decode_image(topic, &bytes).ok());
    let depth = image(guess.depth);
    let float = depth
        .as_ref()
        .is_some_and(|d| matches!(&d.image, Image::Depth(d) if matches!(d.values, DepthValues::Metres(_))));
    let said = guess.depth_units.and_then(first).and_then(|(topic, bytes)| decode_float(topic, &bytes).ok());
    let said = said.or(depth.as_ref().and_then(|d| d.depth_unit)).map(f64::from).filter(|s| (1e-6..=0.1).contains(s));
    let transform =
        |t: usize| first(t).and_then(|(topic, bytes)| decode_transforms(topic, &bytes).ok()?.into_iter().next());
    let pose = match (guess.color_transform.and_then(transform), guess.depth_transform.and_then(transform)) {
        (Some(color), Some(depth)) => Some(realsense::color_from_depth(&color, &depth)),
        _ => image(guess.color).zip(depth).and_then(|(color, depth)| between(log, guess, &color.frame, &depth.frame)),
    };
    LogCameras {
        color: guess.color_info.and_then(camera),
        depth: guess.depth_info.and_then(camera),
        depth_to_color: pose.map(|pose| DepthToColor {
            rotation: glam::DMat3::from_quat(pose.rotation).transpose().to_cols_array_2d(),
            translation_m: pose.translation.into(),
        }),
        // 32-bit floats are rounded to what the user meant: 0.001, not 0.0010000000474974513.
        depth_scale_m: if float { FLOAT_UNIT } else { said.map_or(MILLIMETRE, |s| (s * 1e9).round() / 1e9) },
    }
}

/// From the frame of depth to that of colour, along the log's transforms between frames.
fn between(log: &dyn MessageLog, guess: &Guess, color: &str, depth: &str) -> Option<Pose> {
    if color.is_empty() || color == depth {
        return None;
    }
    // Child frame to parent frame; the first that is said of a child.
    let mut parents: BTreeMap<String, (String, Pose)> = BTreeMap::new();
    for &topic in &guess.transforms {
        let wanted: Vec<(usize, usize)> = (0..log.topics()[topic].count.min(TRANSFORMS)).map(|i| (topic, i)).collect();
        for bytes in log.messages(&wanted).filter_map(|m| m.bytes.ok()) {
            for t in decode_transforms(&log.topics()[topic], &bytes).unwrap_or_default() {
                let pose = t.pose();
                parents.entry(t.child).or_insert((t.parent, pose));
            }
        }
    }
    // Every ancestor of a frame, and the way there.
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
