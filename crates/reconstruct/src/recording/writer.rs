//! Writer of a recording folder.

use super::RecordingInfo;
use crate::Result;
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, Mask};

/// Writes a recording folder: into a folder beside it first, moved into place by [`RecordingWriter::finish`].
pub struct RecordingWriter {}

impl RecordingWriter {
    /// Starts a recording at `dir`, which must not exist or be an earlier recording (one with a `recording.toml`), which is
    /// replaced at the end.
    pub fn create(dir: &Path, info: &RecordingInfo) -> Result<Self> {
        let _ = (dir, info);
        todo!()
    }

    /// The folder being written, for files beyond the recording proper (the truth of a phantom).
    pub fn folder(&self) -> &Path {
        todo!()
    }

    /// Writes frame `index`; frames may come in any order and from many threads.
    pub fn frame(
        &self,
        index: usize,
        color: &ColorImage,
        depth: &DepthImage,
        instruments: Option<&Mask>,
    ) -> Result<()> {
        let _ = (index, color, depth, instruments);
        todo!()
    }

    /// Writes the still mask of an organ.
    pub fn organ_mask(&self, organ: &str, mask: &Mask) -> Result<()> {
        let _ = (organ, mask);
        todo!()
    }

    /// Writes the index and moves the folder into place. Dropped unfinished, the writer removes what it wrote.
    pub fn finish(self) -> Result<()> {
        todo!()
    }
}
