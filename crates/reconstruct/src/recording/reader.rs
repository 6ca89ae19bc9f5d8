//! Streaming reader of a recording folder.

use super::frame_list::{FrameFiles, FrameList, list_frames};
use super::polygon::fill_polygon;
use super::{MARKER, RecordingInfo};
use crate::{Error, Result};
use glam::DVec3;
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_specimen::read_toml;

/// A recording opened for reading; frames are decoded one at a time.
#[derive(Debug)]
pub struct Recording {
    /// Contents of `recording.toml`.
    pub info: RecordingInfo,
    dir: PathBuf,
    frames: Vec<FrameFiles>,
    notes: Vec<String>,
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
    ///
    /// # Errors
    /// Names the file, field or frame that is missing or wrong.
    pub fn open(dir: &Path) -> Result<Self> {
        let toml = dir.join(MARKER);
        if !dir.is_dir() {
            return Err(wrong(dir, "no such folder; a recording is a folder with a recording.toml"));
        }
        if !toml.is_file() {
            return Err(wrong(&toml, "no such file; a recording is a folder with a recording.toml"));
        }
        let mut info: RecordingInfo = read_toml(&toml)?;
        info.validate(&toml)?;
        let FrameList { frames, notes } = list_frames(dir)?;
        let recording = Self { info, dir: dir.to_owned(), frames, notes };
        recording.frame(0)?;
        Ok(recording)
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// What was dropped or replaced while the frames were listed, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The camera of the frames as they are returned: the recorded one, moved along with the depth's pixels.
    pub fn camera(&self) -> Camera {
        let [du, dv] = self.offset();
        let camera = self.info.camera;
        Camera { cx: camera.cx + du as f64, cy: camera.cy + dv as f64, ..camera }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// True without frames (an opened recording never is).
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The files of frame `index`: depth, then colour and instrument mask where it has them.
    pub fn files(&self, index: usize) -> impl Iterator<Item = &Path> {
        let frame = self.frames.get(index);
        frame
            .into_iter()
            .flat_map(|f| [Some(&f.depth), f.color.as_ref(), f.instruments.as_ref()])
            .flatten()
            .map(|p| &**p)
    }

    /// Decodes frame `index`.
    ///
    /// # Errors
    /// Names the file that is missing, broken or of the wrong size.
    pub fn frame(&self, index: usize) -> Result<RgbdFrame> {
        let Some(files) = self.frames.get(index) else {
            return Err(wrong(&self.dir, format!("frame {index} is asked for; the recording has {}", self.len())));
        };
        let depth = DepthImage::read(&files.depth, self.info.depth_scale_m)?;
        let (width, height) = (depth.width, depth.height);
        let camera = self.info.camera;
        let color = match &files.color {
            Some(path) => {
                let color = ColorImage::read(path)?;
                if (color.width, color.height) != (width, height) {
                    let reason = format!(
                        "{width} x {height} pixels, but the colour image {} has {} x {}; depth is registered to colour",
                        path.display(),
                        color.width,
                        color.height
                    );
                    return Err(wrong(&files.depth, reason));
                }
                Some(color)
            }
            None => None,
        };
        if (camera.width, camera.height) != (width, height) {
            let reason = format!(
                "{width} x {height} pixels, but recording.toml says camera.width x camera.height = {} x {}",
                camera.width, camera.height
            );
            return Err(wrong(&files.depth, reason));
        }
        let depth = self.place(depth);
        let color = color.unwrap_or_else(|| shade(&depth, &self.camera()));
        let instruments = match &files.instruments {
            Some(path) => self.mask(path)?,
            None => Mask::new(width, height),
        };
        Ok(RgbdFrame { color, depth, instruments })
    }

    /// The still mask of an organ, from its file or polygon.
    ///
    /// # Errors
    /// When the mask is missing, of another size than the images, or empty.
    pub fn organ_mask(&self, organ: usize) -> Result<Mask> {
        let Some(info) = self.info.organs.get(organ) else {
            return Err(wrong(&self.dir, format!("organ {organ} is asked for; there are {}", self.info.organs.len())));
        };
        let unusable = |reason: String| Error::Organ { organ: info.name.clone(), reason };
        if !info.polygon.is_empty() {
            let mask = fill_polygon(self.info.camera.width, self.info.camera.height, &info.polygon);
            return match mask.count() {
                0 => Err(unusable("its polygon covers no pixel of the image".into())),
                _ => Ok(mask),
            };
        }
        let path = self.dir.join("masks").join(format!("{}.png", info.name));
        if !path.is_file() {
            return Err(unusable(format!(
                "no mask: {} does not exist, and recording.toml gives no polygon",
                path.display()
            )));
        }
        let mask = self.mask(&path)?;
        match mask.count() {
            0 => Err(unusable(format!("no pixel of its mask is set: {}", path.display()))),
            _ => Ok(mask),
        }
    }

    fn mask(&self, path: &Path) -> Result<Mask> {
        let mask = Mask::read(path)?;
        let camera = &self.info.camera;
        if (mask.width, mask.height) != (camera.width, camera.height) {
            let reason = format!(
                "{} x {} pixels, but the recording has {} x {}; masks lie on the image's pixels",
                mask.width, mask.height, camera.width, camera.height
            );
            return Err(wrong(path, reason));
        }
        Ok(mask)
    }

    /// Whole pixels from a depth pixel to its colour pixel.
    fn offset(&self) -> [i64; 2] {
        self.info.depth_offset_px.map(|o| o.round() as i64)
    }

    /// Moves depth onto the colour image's pixels and cuts what is beyond the limit.
    fn place(&self, depth: DepthImage) -> DepthImage {
        let [du, dv] = self.offset();
        let limit = self.info.depth_max_m.map_or(f32::INFINITY, |m| m as f32);
        if [du, dv] == [0, 0] && limit == f32::INFINITY {
            return depth;
        }
        let (width, height) = (depth.width as i64, depth.height as i64);
        let mut out = DepthImage::new(depth.width, depth.height);
        for v in dv.max(0)..height.min(height + dv) {
            for u in du.max(0)..width.min(width + du) {
                let z = depth.depth[((v - dv) * width + u - du) as usize];
                out.depth[(v * width + u) as usize] = if z <= limit { z } else { 0.0 };
            }
        }
        out
    }
}

/// Grey by how much the surface faces the camera: what stands in for colour in a recording of depth alone.
fn shade(depth: &DepthImage, camera: &Camera) -> ColorImage {
    let (width, height) = (depth.width, depth.height);
    let mut image = ColorImage::new(width, height, [0; 3]);
    let point = |u: usize, v: usize| {
        let z = f64::from(depth.depth[v * width + u]);
        let q = DVec3::new((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy, 1.0);
        (z > 0.0).then_some(z * q)
    };
    // Two pixels on each side: a depth step of one unit would otherwise be shaded as a slope.
    const REACH: usize = 2;
    for v in 0..height {
        for u in 0..width {
            let Some(here) = point(u, v) else { continue };
            let along_u = [point(u.saturating_sub(REACH), v), point((u + REACH).min(width - 1), v)];
            let along_v = [point(u, v.saturating_sub(REACH)), point(u, (v + REACH).min(height - 1))];
            let [a, b] = [along_u, along_v].map(|[p, q]| q.unwrap_or(here) - p.unwrap_or(here));
            let facing = a.cross(b).try_normalize().map_or(1.0, |n| n.dot(here.normalize()).abs());
            image.pixels[v * width + u] = [(40.0 + 200.0 * facing) as u8; 3];
        }
    }
    image
}

fn wrong(path: &Path, reason: impl Into<String>) -> Error {
    Error::Recording { path: path.to_owned(), reason: reason.into() }
}
