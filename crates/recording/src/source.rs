//! Where the frames of a recording come from: one trait over folders and log files.

use crate::error::Result;
use trocar_camera::{ColorImage, DepthImage, Mask};
use xxhash_rust::xxh3::Xxh3;

/// One frame as it lies on disk.
#[derive(Debug)]
pub struct Packet {
    /// Index of the frame in the recording.
    pub frame: usize,
    /// Its bytes, or why they cannot be read.
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
    /// Depth [m].
    pub depth: DepthImage,
    /// Pixels of the colour image covered by instruments.
    pub instruments: Option<Mask>,
}

/// Frames in recorded order.
pub trait FrameSource: Send + Sync + std::fmt::Debug {
    /// Number of frames.
    fn len(&self) -> usize;

    /// The `wanted` frames (ascending indices), each exactly once, in the order they lie on disk.
    fn packets<'a>(&'a self, wanted: &[usize]) -> Box<dyn Iterator<Item = Packet> + Send + 'a>;

    /// Decodes what [`FrameSource::packets`] gave for `frame`; may be called from many threads.
    ///
    /// # Errors
    /// Names the file or message that is broken.
    fn decode(&self, frame: usize, parts: &Parts) -> Result<Images>;

    /// What to call frame `index` in a message: its depth file, or its number and time.
    fn name(&self, index: usize) -> String;

    /// Stem of the file name of frame `index`'s instrument mask in `masks/instruments`.
    fn mask_stem(&self, index: usize) -> String;

    /// What was dropped or replaced while the frames were listed, a sentence each.
    fn notes(&self) -> &[String];

    /// What the source holds, a line each: the topics of a log.
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
