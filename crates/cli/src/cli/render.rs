//! Arguments of `render`.

use clap::Args;
use std::path::PathBuf;

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Specimen folder; a scene file or built-in scene such as cell-a, whose scripted grasp-lift moving pictures show; or an episode's folder or its
    /// episode.trocar, which is done again and filmed.
    pub source: String,
    /// Camera: recording or outside of a specimen; the scene's (endoscope, d405, recording) or outside of a scene; the first by default.
    #[arg(long)]
    pub camera: Option<String>,
    /// Picture to write: .png, or .webp or .mp4 (by ffmpeg) for a moving one.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Follow paths of light instead of direct light alone.
    #[arg(long)]
    pub path: bool,
    /// Paths a pixel; 64 by default.
    #[arg(long, requires = "path")]
    pub samples: Option<u32>,
    /// Width and height [px], such as 1280x720; the camera's own by default, of moving pictures 360 high at most.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[usize; 2]>,
    /// Write depth, too: FILE-depth.png in tenths of a millimetre, and FILE-depth-shown.png in colours.
    #[arg(long)]
    pub depth: bool,
    /// Write what each pixel shows, too: FILE-labels.png.
    #[arg(long)]
    pub labels: bool,
    /// Seconds into the scripted grasp-lift of a scene (its start by default) or into an episode (its end by default).
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub at: Option<f64>,
    /// Add the noise of sensors.
    #[arg(long)]
    pub noise: bool,
    /// Cut the organs open by an upright plane that faces the camera.
    #[arg(long)]
    pub cut_away: bool,
    /// Worker threads of the simulation; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Specimen folder of an episode, where it is no longer where the scene says.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|s| s.iter().all(|n| (8..=8192).contains(n)))
        .ok_or_else(|| "width x height, 8 to 8192 pixels each: 1280x720".to_owned())
}
