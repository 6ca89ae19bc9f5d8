//! Sources of a recording's frames: one trait for folders and log files.

use crate::error::Result;
use trocar_camera::{ColorImage, DepthImage, Mask};
use xxhash_rust::xxh3::Xxh3;

/// One undecoded frame.
#[derive(Debug)]
pub struct Packet {
    /// Index of the frame in the recording.
    pub frame: usize,
    /// Its bytes, or the reason why they cannot be read.
    pub parts: Result<Parts>,
}

/// The undecoded bytes of a frame.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Colour image; absent in a recording of depth alone.
    pub color: Option<Vec<u8>>,
    /// Depth image.
    pub depth: Vec<u8>,
    /// Instrument mask; absent where the recording has none.
    pub instruments: Option<Vec<u8>>,
}

/// The decoded images of a frame, each on its own camera's pixels.
#[derive(Clone, Debug)]
pub struct Images {
    /// Colour.
    pub color: Option<ColorImage>,
    /// Depth (m).
    pub depth: DepthImage,
    /// Pixels of the colour image that instruments cover.
    pub instruments: Option<Mask>,
}

/// Frames in recorded order.
pub trait FrameSource: Send + Sync + std::fmt::Debug {
    /// Number of frames.
    fn len(&self) -> usize;

    /// The `wanted` frames (ascending indices), each exactly once, in the order of the file.
    fn packets<'a>(&'a self, wanted: &[usize]) -> Box<dyn Iterator<Item = Packet> + Send + 'a>;

    /// Decodes the bytes of [`FrameSource::packets`] for `frame`. May be called from many threads.
    ///
    /// # Errors
    /// Names the broken file or message.
    fn decode(&self, frame: usize, parts: &Parts) -> Result<Images>;

    /// Name of frame `index` in messages: its depth file, or its number and time.
    fn name(&self, index: usize) -> String;

    /// Stem of the file name of frame `index`'s instrument mask in `masks/instruments`.
    fn mask_stem(&self, index: usize) -> String;

    /// Notes on dropped or replaced frames, one sentence each.
    fn notes(&self) -> &[String];

    /// The contents of the source, one line each: the topics of a log.
    fn describe(&self) -> Vec<String> {
        Vec::new()
    }
}

impl Parts {
    /// Hash of all bytes.
    pub fn hash(&self) -> u64 {
        let mut hash = Xxh3::new();
        for part in [self.color.as_deref(), Some(&self.depth), self.instruments.as_deref()] {
            let bytes = part.unwrap_or_default();
            hash.update(&(bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        }
        hash.digest()
    }
}
