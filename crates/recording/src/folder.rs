//! Frames from folders of image files.

use crate::error::{Error, Result};
use crate::frame_list::{FrameFiles, FrameList, list_frames, stem};
use crate::source::{FrameSource, Images, Packet, Parts};
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, Mask};

/// The images of a recording folder, one file per image.
#[derive(Debug)]
pub struct Folder {
    frames: Vec<FrameFiles>,
    notes: Vec<String>,
    depth_scale_m: f64,
}

impl Folder {
    /// Lists the frames of the recording folder `dir`, whose depth has the unit `depth_scale_m`
    /// (m).
    pub fn open(dir: &Path, depth_scale_m: f64) -> Result<Self> {
        let FrameList { frames, notes } = list_frames(dir)?;
        Ok(Self { frames, notes, depth_scale_m })
    }
}

impl FrameSource for Folder {
    fn len(&self) -> usize {
        self.frames.len()
    }

    fn packets<'a>(&'a self, wanted: &[usize]) -> Box<dyn Iterator<Item = Packet> + Send + 'a> {
        let read = |path: &Path| std::fs::read(path).map_err(Error::io(path));
        let parts = move |files: &FrameFiles| {
            Ok(Parts {
                color: files.color.as_deref().map(read).transpose()?,
                depth: read(&files.depth)?,
                instruments: files.instruments.as_deref().map(read).transpose()?,
            })
        };
        let wanted: Vec<usize> = wanted.iter().copied().filter(|i| *i < self.frames.len()).collect();
        Box::new(wanted.into_iter().map(move |frame| Packet { frame, parts: parts(&self.frames[frame]) }))
    }

    fn decode(&self, frame: usize, parts: &Parts) -> Result<Images> {
        let files = &self.frames[frame];
        let color = match (&files.color, &parts.color) {
            (Some(path), Some(bytes)) => Some(ColorImage::decode(bytes, path)?),
            _ => None,
        };
        let instruments = match (&files.instruments, &parts.instruments) {
            (Some(path), Some(bytes)) => Some(Mask::decode(bytes, path)?),
            _ => None,
        };
        Ok(Images { color, depth: DepthImage::decode(&parts.depth, &files.depth, self.depth_scale_m)?, instruments })
    }

    fn name(&self, index: usize) -> String {
        self.frames[index].depth.display().to_string()
    }

    fn mask_stem(&self, index: usize) -> String {
        let files = &self.frames[index];
        stem(files.color.as_ref().unwrap_or(&files.depth))
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
