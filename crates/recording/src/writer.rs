//! Writer of a recording folder.

use crate::error::{Error, Result};
use crate::info::{MARKER, RecordingInfo};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_specimen::StagedFolder;

/// Writes a recording folder. Files go to a folder beside it, which [`RecordingWriter::finish`]
/// moves into place.
///
/// ```
/// use trocar_camera::{Camera, ColorImage, DepthImage};
/// use trocar_recording::{Recording, RecordingInfo, RecordingWriter};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("recording");
/// let info = RecordingInfo {
///     rate_hz: Some(30.0),
///     depth_scale_m: Some(0.001),
///     camera: Some(Camera::centred(64, 48, 1.0)),
///     source: None,
///     ..RecordingInfo::of_log("still".as_ref())
/// };
/// let writer = RecordingWriter::create(&path, &info)?;
/// let mut depth = DepthImage::new(64, 48);
/// depth.depth.fill(0.3);
/// writer.frame(0, &ColorImage::new(64, 48, [170, 60, 50]), &depth, None)?;
/// writer.finish()?;
/// assert_eq!(Recording::open(&path)?.frame(0)?.depth.depth[0], 0.3);
/// # Ok(())
/// # }
/// ```
pub struct RecordingWriter {
    folder: StagedFolder,
    rate_hz: f64,
    depth_scale_m: f64,
    /// Frames written so far, and whether each has an instrument mask.
    frames: Mutex<BTreeMap<usize, bool>>,
}

impl RecordingWriter {
    /// Starts a recording at `dir`, which must not exist or be an earlier recording (with a
    /// `recording.toml`), which is replaced at the end. Creates missing parents.
    ///
    /// # Errors
    /// When the reader would refuse `info`, or when `dir` is another kind of folder or cannot be
    /// written.
    pub fn create(dir: &Path, info: &RecordingInfo) -> Result<Self> {
        let mut info = info.clone();
        let marker = dir.join(MARKER);
        info.validate(&marker)?;
        let (Some(rate_hz), Some(depth_scale_m), None) = (info.rate_hz, info.depth_scale_m, &info.source) else {
            let reason = "a written recording needs rate_hz and depth_scale_m, and must not have [source]";
            return Err(Error::wrong(&marker, reason));
        };
        let folder = StagedFolder::create(dir, MARKER)?;
        for sub in ["color", "depth", "masks/instruments"] {
            let path = folder.path().join(sub);
            std::fs::create_dir_all(&path).map_err(Error::io(&path))?;
        }
        let path = folder.path().join(MARKER);
        let text = toml::to_string(&info).map_err(|e| Error::wrong(&path, format!("cannot be written: {e}")))?;
        write(&path, text.as_bytes())?;
        Ok(Self { folder, rate_hz, depth_scale_m, frames: Mutex::new(BTreeMap::new()) })
    }

    /// The folder being written, for files beyond the recording itself (the truth of a phantom).
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Writes frame `index`; frames may come in any order and from many threads.
    ///
    /// # Errors
    /// When the frame was written before, or a file cannot be written.
    pub fn frame(
        &self,
        index: usize,
        color: &ColorImage,
        depth: &DepthImage,
        instruments: Option<&Mask>,
    ) -> Result<()> {
        {
            let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
            if frames.insert(index, instruments.is_some()).is_some() {
                return Err(self.wrong(format!("frame {index} is written twice")));
            }
        }
        color.write_png(&self.folder().join(color_file(index)))?;
        depth.write_png(&self.folder().join(depth_file(index)), self.depth_scale_m)?;
        if let Some(mask) = instruments {
            mask.write_png(&self.folder().join(instruments_file(index)))?;
        }
        Ok(())
    }

    /// Writes the still mask of an organ.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn organ_mask(&self, organ: &str, mask: &Mask) -> Result<()> {
        Ok(mask.write_png(&self.folder().join("masks").join(format!("{organ}.png")))?)
    }

    /// Writes the index and moves the folder into place. A writer that is dropped unfinished
    /// removes its files.
    ///
    /// # Errors
    /// When there is no frame, or the folder cannot be moved into place.
    pub fn finish(self) -> Result<()> {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if frames.is_empty() {
            return Err(self.wrong("the recording has no frames".into()));
        }
        let mut index = String::from("index,time_s,color,depth,instruments\n");
        for (i, instruments) in frames {
            let mask = if instruments { instruments_file(i) } else { String::new() };
            let time = i as f64 / self.rate_hz;
            index.push_str(&format!("{i},{time:.6},{},{},{mask}\n", color_file(i), depth_file(i)));
        }
        write(&self.folder().join("frames.csv"), index.as_bytes())?;
        Ok(self.folder.commit()?)
    }

    fn wrong(&self, reason: String) -> Error {
        Error::wrong(self.folder(), reason)
    }
}

fn color_file(index: usize) -> String {
    format!("color/{index:06}.png")
}

fn depth_file(index: usize) -> String {
    format!("depth/{index:06}.png")
}

fn instruments_file(index: usize) -> String {
    format!("masks/instruments/{index:06}.png")
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(Error::io(path))
}
