//! Filming a phantom.

use crate::Result;
use std::path::Path;
use trocar_progress::Progress;

/// How a phantom is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordOptions {
    /// Frames to record at 30 Hz (paper: 60 s).
    pub frames: usize,
    /// Seed of the anatomy and of the noise.
    pub seed: u64,
}

/// Records the phantom `name` (`phantom-a`) into the folder `dir`.
pub fn record(name: &str, options: &RecordOptions, dir: &Path, progress: &dyn Progress) -> Result<()> {
    let _ = (name, options, dir, progress);
    todo!()
}
