//! Arguments of `render`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct Render {
    /// Specimen folder; scene file or built-in scene such as cell-a, whose videos show a scripted
    /// grasp-lift; or episode folder or its episode.trocar, which is replayed.
    pub source: String,
    /// Camera. A specimen has recording and outside; a scene has its cameras (endoscope, d405,
    /// recording) and outside. By default the first.
    #[arg(long)]
    pub camera: Option<String>,
    /// Picture (.png, .jpg) or video (.webp, or .mp4 by ffmpeg) to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Path tracing instead of only direct light.
    #[arg(long)]
    pub path: bool,
    /// Paths per pixel; 64 by default.
    #[arg(long, requires = "path")]
    pub samples: Option<u32>,
    /// Filter the noise of the paths out; 16 paths are then the default.
    #[arg(long, requires = "path")]
    pub denoise: bool,
    /// Width and height (px), each 8 to 8192, such as 1280x720; by default those of the camera, and
    /// for videos at most 360 px high.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[usize; 2]>,
    /// Also write depth: FILE-depth.png in tenths of a millimetre, and FILE-depth-shown.png in
    /// colours.
    #[arg(long)]
    pub depth: bool,
    /// Also write the label of each pixel: FILE-labels.png.
    #[arg(long)]
    pub labels: bool,
    /// Time (s) in the scripted grasp-lift of a scene (by default its start) or in an episode (by
    /// default its end).
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub at: Option<f64>,
    /// Add sensor noise.
    #[arg(long)]
    pub noise: bool,
    /// Cut the organs open along an upright plane that faces the camera.
    #[arg(long)]
    pub cut_away: bool,
    /// Worker threads of the simulation; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Specimen folder of an episode, if it was moved from its place in the scene.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
}

/// Width and height of pictures, for the command line.
pub fn size(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|s| s.iter().all(|n| (8..=8192).contains(n)))
        .ok_or_else(|| "it must be width x height, each 8 to 8192 pixels, such as 1280x720".to_owned())
}
