//! Video files: animated WebP, and MP4 by the program ffmpeg.

use crate::{Error, Result};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use trocar_camera::ColorImage;
use webp::{AnimEncoder, AnimFrame, WebPConfig};

/// Quality of WebP, 0 to 100.
const QUALITY: f32 = 72.0;

/// Maximum memory of the frames of a WebP (bytes).
const MAX_BYTES: usize = 2 << 30;

/// Writes a video. Its file appears when it is finished.
pub(crate) enum VideoWriter {
    /// Frames with their times (ms).
    Webp(Vec<(ColorImage, i32)>),
    /// The partial file and the encoder, which starts with the first frame, whose size it needs.
    Mp4 { part: PathBuf, encoder: Option<Child> },
}

impl VideoWriter {
    /// Begins the video `output` in the format `extension`.
    pub fn begin(output: &Path, extension: &str) -> Result<Self> {
        let folder = output.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(Error::Mismatch(format!(
                "{}: the folder {} does not exist",
                output.display(),
                folder.display()
            )));
        }
        if extension != "mp4" {
            return Ok(Self::Webp(Vec::new()));
        }
        let there = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !there.is_ok_and(|status| status.success()) {
            let reason = ".mp4 needs the program ffmpeg, which is not installed; install it, or write a .webp";
            return Err(Error::Mismatch(format!("{}: {reason}", output.display())));
        }
        Ok(Self::Mp4 { part: partial_path(output), encoder: None })
    }

    /// Adds a frame that begins at `time_ms` in a video of `hz` frames per second.
    pub fn add(&mut self, frame: ColorImage, time_ms: f64, hz: u32) -> Result<()> {
        match self {
            Self::Webp(frames) => {
                if (frames.len() + 1) * frame.pixels.len() * 3 > MAX_BYTES {
                    let reason = "the frames of a .webp are more than 2 GiB; choose a smaller --size, or .mp4";
                    return Err(Error::Mismatch(reason.to_owned()));
                }
                frames.push((frame, time_ms.round() as i32));
                Ok(())
            }
            Self::Mp4 { part, encoder } => {
                let failed = |source: std::io::Error| Error::Io { path: part.clone(), source };
                if encoder.is_none() {
                    let size = format!("{}x{}", frame.width, frame.height);
                    let mut command = Command::new("ffmpeg");
                    command.args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size]);
                    command.args(["-r", &hz.to_string(), "-i", "-", "-c:v", "libx264", "-pix_fmt", "yuv420p"]);
                    command.args(["-crf", "19", "-movflags", "+faststart", "-f", "mp4"]).arg(&*part);
                    *encoder = Some(command.stdin(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(failed)?);
                }
                let pipe = encoder.as_mut().and_then(|child| child.stdin.as_mut());
                pipe.map_or(Ok(()), |pipe| pipe.write_all(frame.pixels.as_flattened())).map_err(failed)
            }
        }
    }

    /// Writes the file `output`.
    pub fn finish(mut self, output: &Path) -> Result<()> {
        match &mut self {
            Self::Webp(frames) => write_whole(output, &webp(frames)?),
            Self::Mp4 { part, encoder } => {
                let status = encoder.take().map(|mut child| {
                    drop(child.stdin.take());
                    child.wait()
                });
                if !status.is_some_and(|s| s.is_ok_and(|s| s.success())) {
                    return Err(Error::Mismatch(format!("{}: ffmpeg failed", output.display())));
                }
                std::fs::rename(&*part, output).map_err(|source| Error::Io { path: output.to_owned(), source })
            }
        }
    }
}

/// Writes a file whole or not at all.
pub(crate) fn write_whole(output: &Path, bytes: &[u8]) -> Result<()> {
    let part = partial_path(output);
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, output)).map_err(|source| {
        // A partial file must not stay.
        let _ = std::fs::remove_file(&part);
        Error::Io { path: output.to_owned(), source }
    })
}

fn partial_path(output: &Path) -> PathBuf {
    let name = output.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    output.with_file_name(format!(".{}-{name}", std::process::id()))
}

impl Drop for VideoWriter {
    /// Removes the partial file of an unfinished video.
    fn drop(&mut self) {
        if let Self::Mp4 { part, encoder } = self {
            if let Some(mut child) = encoder.take() {
                // The encoder may have ended already.
                let _ = child.kill();
                let _ = child.wait();
            }
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Encodes frames with their times (ms) as an animated WebP that repeats for ever.
///
/// # Errors
/// Frames that cannot be encoded.
pub fn webp(frames: &[(ColorImage, i32)]) -> Result<Vec<u8>> {
    let Some((first, _)) = frames.first() else { return Err(Error::NoFrames) };
    let failed = |why: &str| Error::Format(format!("the video cannot be encoded: {why}"));
    let mut config = WebPConfig::new().map_err(|()| failed("libwebp has another version"))?;
    config.quality = QUALITY;
    config.method = 4;
    let mut encoder = AnimEncoder::new(first.width as u32, first.height as u32, &config);
    for (frame, time) in frames {
        let (width, height) = (frame.width as u32, frame.height as u32);
        encoder.add_frame(AnimFrame::from_rgb(frame.pixels.as_flattened(), width, height, *time));
    }
    Ok(encoder.try_encode().map_err(|why| failed(&format!("{why:?}")))?.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_webp_moves_and_comes_back() {
        let frames: Vec<(ColorImage, i32)> =
            (0..3).map(|i| (ColorImage::new(32, 24, [80 * i as u8, 40, 200]), 66 * i)).collect();
        let bytes = webp(&frames).unwrap();
        assert_eq!(&bytes[..4], b"RIFF");
        let back = webp::AnimDecoder::new(&bytes).decode().unwrap();
        assert!(back.has_animation() && back.len() == 3);
        for (k, (frame, _)) in frames.iter().enumerate() {
            let shown = back.get_frame(k).unwrap();
            let seen = shown.get_image();
            let mean = |c: usize| seen.chunks(4).map(|p| f64::from(p[c])).sum::<f64>() / (32.0 * 24.0);
            assert!((0..3).all(|c| (mean(c) - f64::from(frame.pixels[0][c])).abs() < 6.0), "frame {k}");
        }
        assert!(webp(&[]).is_err());
    }
}
