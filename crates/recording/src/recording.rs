//! A recording opened for reading: frames stream from their source and come out registered, on one camera's pixels.

use crate::folder::Folder;
use crate::register::Registration;
use crate::shade::shade;
use crate::source::{FrameSource, Images, Packet, Parts};
use crate::{Error, MARKER, RecordingInfo, Result};
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_specimen::read_toml;

/// How many of the first frames may be broken before the recording is refused.
const BROKEN_AT_START: usize = 10;

/// A recording opened for reading.
#[derive(Debug)]
pub struct Recording {
    /// Contents of `recording.toml`.
    pub info: RecordingInfo,
    toml: PathBuf,
    source: Box<dyn FrameSource>,
    /// Camera of the frames as they are returned.
    camera: Camera,
    depth_scale_m: f64,
    registration: Option<Registration>,
    notes: Vec<String>,
}

/// One frame.
#[derive(Clone, Debug)]
pub struct RgbdFrame {
    /// Colour.
    pub color: ColorImage,
    /// Depth on the colour image's pixels [m].
    pub depth: DepthImage,
    /// Pixels covered by instruments as far as the recording has masks; none set where it has none.
    pub instruments: Mask,
}

impl Recording {
    /// Opens a folder with a `recording.toml`, and checks that its parts fit together (at least one whole frame, sizes).
    ///
    /// # Errors
    /// Names the file, field or frame that is missing or wrong.
    pub fn open(path: &Path) -> Result<Self> {
        let toml = path.join(MARKER);
        if !path.is_dir() {
            return Err(Error::wrong(path, "no such folder; a recording is a folder with a recording.toml"));
        }
        if !toml.is_file() {
            return Err(Error::wrong(&toml, "no such file; a recording is a folder with a recording.toml"));
        }
        let mut info: RecordingInfo = read_toml(&toml)?;
        info.validate(&toml)?;
        let (Some(camera), Some(depth_scale_m)) = (info.camera, info.depth_scale_m) else {
            return Err(Error::wrong(&toml, "[camera] and depth_scale_m are needed"));
        };
        let source = Folder::open(path, depth_scale_m)?;
        let registration = match (info.depth_camera, info.depth_to_color) {
            (Some(depth), Some(motion)) => Some(Registration {
                depth,
                color: camera,
                rotation: motion.matrix(),
                translation: motion.translation_m.into(),
            }),
            _ => None,
        };
        let mut recording = Self {
            notes: source.notes().to_vec(),
            source: Box::new(source),
            camera,
            depth_scale_m,
            registration,
            toml,
            info,
        };
        let [du, dv] = recording.offset();
        recording.camera.cx += du as f64;
        recording.camera.cy += dv as f64;
        recording.probe()?;
        Ok(recording)
    }

    /// Decodes the first frame that can be: what is wrong with all of them is wrong with the recording.
    fn probe(&self) -> Result<()> {
        let mut first_error = None;
        for index in 0..self.len().min(BROKEN_AT_START) {
            match self.frame(index) {
                Ok(_) => return Ok(()),
                Err(e) => first_error = first_error.or(Some(e)),
            }
        }
        Err(first_error.unwrap_or_else(|| Error::wrong(self.dir(), "no frames")))
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        self.toml.parent().unwrap_or(Path::new("."))
    }

    /// The `recording.toml`.
    pub fn toml(&self) -> &Path {
        &self.toml
    }

    /// What was dropped or replaced while the frames were listed, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The camera of the frames as they are returned: colour's; without colour, the depth's.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Metres per unit of recorded depth.
    pub fn depth_scale(&self) -> f64 {
        self.depth_scale_m
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// True without frames (an opened recording never is).
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What to call frame `index` in a message.
    pub fn frame_name(&self, index: usize) -> String {
        self.source.name(index)
    }

    /// The `wanted` frames (ascending indices) undecoded, in the order they lie on disk.
    pub fn packets<'a>(&'a self, wanted: &[usize]) -> Box<dyn Iterator<Item = Packet> + Send + 'a> {
        self.source.packets(wanted)
    }

    /// Decodes frame `index`.
    ///
    /// # Errors
    /// Names the file that is missing, broken or of the wrong size.
    pub fn frame(&self, index: usize) -> Result<RgbdFrame> {
        match self.packets(&[index]).next() {
            Some(packet) => self.decode(index, &packet.parts?),
            None => {
                let reason = format!("frame {index} is asked for; the recording has {}", self.len());
                Err(Error::wrong(self.dir(), reason))
            }
        }
    }

    /// Turns the bytes of frame `index` into images on [`Recording::camera`]'s pixels; may be called from many threads.
    ///
    /// # Errors
    /// Names the file that is broken or of the wrong size.
    pub fn decode(&self, index: usize, parts: &Parts) -> Result<RgbdFrame> {
        let Images { color, depth, instruments } = self.source.decode(index, parts)?;
        let wrong = |reason: String| Error::wrong(Path::new(&self.source.name(index)), reason);
        let size = (self.camera.width, self.camera.height);
        let depth_camera = self.registration.as_ref().map_or(&self.camera, |r| &r.depth);
        if (depth.width, depth.height) != (depth_camera.width, depth_camera.height) {
            let field = if self.registration.is_some() { "depth_camera" } else { "camera" };
            return Err(wrong(format!(
                "{} x {} pixels, but recording.toml says {field}.width x {field}.height = {} x {}",
                depth.width, depth.height, depth_camera.width, depth_camera.height
            )));
        }
        if let Some(color) = &color
            && (color.width, color.height) != size
        {
            let hint = if self.registration.is_some() { "" } else { "; depth of another size needs [depth_camera]" };
            let reason = format!(
                "its colour image has {} x {} pixels, but recording.toml says camera.width x camera.height = {} x {}{hint}",
                color.width, color.height, size.0, size.1
            );
            return Err(wrong(reason));
        }
        if let Some(mask) = &instruments
            && (mask.width, mask.height) != size
        {
            let reason = format!(
                "its instrument mask has {} x {} pixels, but the images have {} x {}; masks lie on the image's pixels",
                mask.width, mask.height, size.0, size.1
            );
            return Err(wrong(reason));
        }
        let depth = self.place(depth);
        let color = color.unwrap_or_else(|| shade(&depth, &self.camera));
        let instruments = instruments.unwrap_or_else(|| Mask::new(size.0, size.1));
        Ok(RgbdFrame { color, depth, instruments })
    }

    /// Whole pixels from a depth pixel to its colour pixel.
    fn offset(&self) -> [i64; 2] {
        self.info.depth_offset_px.map(|o| o.round() as i64)
    }

    /// Moves depth onto the colour image's pixels and cuts what is beyond the limit.
    fn place(&self, depth: DepthImage) -> DepthImage {
        let mut out = match (&self.registration, self.offset()) {
            (Some(registration), _) => registration.apply(&depth),
            (None, [0, 0]) => depth,
            (None, [du, dv]) => shifted(&depth, du, dv),
        };
        if let Some(limit) = self.info.depth_max_m {
            for z in out.depth.iter_mut().filter(|z| **z > limit as f32) {
                *z = 0.0;
            }
        }
        out
    }
}

fn shifted(depth: &DepthImage, du: i64, dv: i64) -> DepthImage {
    let (width, height) = (depth.width as i64, depth.height as i64);
    let mut out = DepthImage::new(depth.width, depth.height);
    for v in dv.max(0)..height.min(height + dv) {
        for u in du.max(0)..width.min(width + du) {
            out.depth[(v * width + u) as usize] = depth.depth[((v - dv) * width + u - du) as usize];
        }
    }
    out
}
