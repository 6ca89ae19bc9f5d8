//! Streaming reader of a recording folder.

use super::RecordingInfo;
use crate::Result;
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, Mask};

/// A recording opened for reading; frames are decoded one at a time.
pub struct Recording {
    /// Contents of `recording.toml`.
    pub info: RecordingInfo,
}

/// One frame.
#[derive(Clone, Debug)]
pub struct RgbdFrame {
    /// Colour.
    pub color: ColorImage,
    /// Depth, on the colour image's pixels (the offset of `recording.toml` applied).
    pub depth: DepthImage,
    /// Pixels covered by instruments; none set where the recording has no instrument masks.
    pub instruments: Mask,
}

impl Recording {
    /// Opens a folder and checks that its parts fit together (`recording.toml`, at least one frame, sizes).
    pub fn open(dir: &Path) -> Result<Self> {
        let _ = dir;
        todo!()
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        todo!()
    }

    /// True without frames (an opened recording never is).
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Decodes frame `index`.
    pub fn frame(&self, index: usize) -> Result<RgbdFrame> {
        let _ = index;
        todo!()
    }

    /// The still mask of an organ, from its file or polygon.
    pub fn organ_mask(&self, organ: usize) -> Result<Mask> {
        let _ = organ;
        todo!()
    }
}
