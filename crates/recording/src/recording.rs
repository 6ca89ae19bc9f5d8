//! Reads recordings: frames stream from their source, registered to the pixels of one camera.

use crate::error::{Error, Result};
use crate::folder::Folder;
use crate::info::{DepthToColor, MARKER, RecordingInfo, SourceInfo};
use crate::log::{Log, LogCameras};
use crate::register::Registration;
use crate::shade::shade;
use crate::source::{FrameSource, Images, Packet, Parts};
use glam::DMat3;
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_specimen::read_toml;

/// Number of first frames that may all be broken before the recording is refused.
const BROKEN_AT_START: usize = 10;

/// A recording opened for reading.
///
/// ```no_run
/// # fn main() -> trocar_recording::Result<()> {
/// use std::path::Path;
/// use trocar_recording::Recording;
///
/// let recording = Recording::open(Path::new("session.bag"))?;
/// for packet in recording.packets(&[0, 1, 2]) {
///     let frame = recording.decode(packet.frame, &packet.parts?)?;
///     println!("{}: {} x {}", recording.frame_name(packet.frame), frame.color.width, frame.color.height);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Recording {
    /// Contents of `recording.toml`.
    pub info: RecordingInfo,
    toml: PathBuf,
    source: Box<dyn FrameSource>,
    /// Camera of the returned frames.
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
    /// Depth on the colour image's pixels (m).
    pub depth: DepthImage,
    /// Pixels of instruments by the recording's masks; empty where it has none.
    pub instruments: Mask,
}

impl Recording {
    /// Opens a recording and checks that its parts fit together (sizes, at least one good frame).
    /// `path` is a folder with a `recording.toml`, or a `.bag` or `.mcap` file with an optional
    /// `.toml` of the same name beside it.
    ///
    /// # Errors
    /// Names the file, field or frame that is missing or wrong.
    pub fn open(path: &Path) -> Result<Self> {
        let log = path.is_file().then(|| path.file_name().map(|n| n.to_string_lossy().into_owned())).flatten();
        let toml = if log.is_some() { path.with_extension("toml") } else { path.join(MARKER) };
        let mut info = match (&log, toml.is_file()) {
            (_, true) => read_toml(&toml)?,
            (Some(_), false) => RecordingInfo::of_log(path),
            (None, false) if !path.is_dir() => {
                let reason = "no such file or folder; a recording is a folder with a recording.toml, a .bag file or an .mcap file";
                return Err(Error::wrong(path, reason));
            }
            (None, false) => {
                return Err(Error::wrong(&toml, "no such file; a recording is a folder with a recording.toml"));
            }
        };
        if let Some(file) = log {
            let named = info.source.get_or_insert_with(|| SourceInfo { file: file.clone(), ..SourceInfo::default() });
            if named.file != file {
                return Err(Error::wrong(
                    &toml,
                    format!("source.file is '{}'; it must be '{file}', the log beside it", named.file),
                ));
            }
        }
        info.validate(&toml)?;
        let dir = toml.parent().unwrap_or(Path::new("."));
        let (source, said): (Box<dyn FrameSource>, LogCameras) = match (&info.source, info.depth_scale_m) {
            (Some(log), scale) => {
                let (log, said) = Log::open(dir, log, scale)?;
                (Box::new(log), said)
            }
            (None, Some(scale)) => {
                let said = LogCameras { depth_scale_m: scale, ..LogCameras::default() };
                (Box::new(Folder::open(dir, scale)?), said)
            }
            (None, None) => {
                return Err(Error::wrong(&toml, "depth_scale_m is missing: the unit of the depth images in metres"));
            }
        };
        let depth_scale_m = said.depth_scale_m;
        let (camera, registration) = cameras(&info, &said).map_err(|reason| Error::wrong(&toml, reason))?;
        let mut notes = source.notes().to_vec();
        if info.source.is_some() && info.depth_camera.or(said.depth).is_none() {
            notes.push("The depth camera is unknown; its images count as registered to colour.".into());
        }
        let mut recording = Self { notes, source, camera, depth_scale_m, registration, toml, info };
        let [du, dv] = recording.offset();
        recording.camera.cx += du as f64;
        recording.camera.cy += dv as f64;
        recording.check_lifts()?;
        recording.probe()?;
        Ok(recording)
    }

    /// Checks that the lifts have frames and pixels of this recording.
    fn check_lifts(&self) -> Result<()> {
        for (i, lift) in self.info.lifts.iter().enumerate() {
            let wrong = |reason: String| Error::wrong(&self.toml, format!("lift[{i}].{reason}"));
            lift.validate_frames(self.len()).map_err(wrong)?;
            lift.validate_click(&self.camera).map_err(wrong)?;
        }
        Ok(())
    }

    /// Decodes the first good frame. A defect of all first frames is a defect of the recording.
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

    /// Notes on dropped or replaced frames, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The topics of the recording's log, one line each; empty for a folder of images.
    pub fn describe(&self) -> Vec<String> {
        self.source.describe()
    }

    /// The registration of depth to colour, where depth has a camera of its own.
    pub fn registration(&self) -> Option<&Registration> {
        self.registration.as_ref()
    }

    /// The camera of the returned frames: colour's, or depth's without colour.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Unit of recorded depth (m).
    pub fn depth_scale(&self) -> f64 {
        self.depth_scale_m
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// True without frames; an opened recording has at least one.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The file of an organ's mask, whether it exists or not.
    pub fn organ_mask_file(&self, organ: &str) -> PathBuf {
        self.dir().join("masks").join(format!("{organ}.png"))
    }

    /// File name of frame `index`'s instrument mask in `masks/instruments`.
    pub fn mask_file_name(&self, index: usize) -> String {
        format!("{}.png", self.source.mask_stem(index))
    }

    /// Name of frame `index` in messages.
    pub fn frame_name(&self, index: usize) -> String {
        self.source.name(index)
    }

    /// The `wanted` frames (ascending indices), undecoded, in the order of the file.
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
                let reason = format!("frame {index} does not exist; the recording has {} frames", self.len());
                Err(Error::wrong(self.dir(), reason))
            }
        }
    }

    /// Decodes the bytes of frame `index` into images on [`Recording::camera`]'s pixels. May be
    /// called from many threads.
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
                "it has {} x {} pixels, but in recording.toml or the log {field}.width x {field}.height = {} x {}",
                depth.width, depth.height, depth_camera.width, depth_camera.height
            )));
        }
        if let Some(color) = &color
            && (color.width, color.height) != size
        {
            let hint = if self.registration.is_some() { "" } else { "; depth of another size needs [depth_camera]" };
            let reason = format!(
                "its colour image has {} x {} pixels, but in recording.toml camera.width x camera.height = {} x {}{hint}",
                color.width, color.height, size.0, size.1
            );
            return Err(wrong(reason));
        }
        if let Some(mask) = &instruments
            && (mask.width, mask.height) != size
        {
            let reason = format!(
                "its instrument mask has {} x {} pixels; it must have the image's {} x {}",
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

    /// Moves depth to the colour image's pixels and removes depth beyond the limit.
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

/// The camera of the frames and the registration of depth, from the user's facts or else from the
/// log's.
fn cameras(info: &RecordingInfo, said: &LogCameras) -> std::result::Result<(Camera, Option<Registration>), String> {
    let missing = "the log has no calibration of its colour camera; add [camera] with width, height, fx, fy, cx, cy";
    let color = info.camera.or(said.color).ok_or(missing)?;
    let Some(depth) = info.depth_camera.or(said.depth) else { return Ok((color, None)) };
    let same_place = |m: &DepthToColor| {
        let turned = (m.matrix() - DMat3::IDENTITY).to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        turned < 1e-6 && m.translation_m.iter().all(|t| t.abs() < 1e-6)
    };
    match info.depth_to_color.or(said.depth_to_color) {
        Some(motion) if depth != color || !same_place(&motion) => Ok((
            color,
            Some(Registration {
                depth,
                color,
                rotation: motion.matrix(),
                translation: motion.translation_m.into(),
            }),
        )),
        Some(_) => Ok((color, None)),
        // Depth aligned to colour has colour's camera, apart from rounding.
        None if (depth.width, depth.height) == (color.width, color.height) && (depth.fx / color.fx - 1.0).abs() < 0.01 => {
            Ok((color, None))
        }
        None => Err("the log's depth camera is not its colour camera, and the log has no transform between them; \
                     add [depth_to_color] with rotation and translation_m, or choose the topic of depth aligned to colour"
            .into()),
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
