//! Arguments of `render`.

use clap::Args;
use std::path::PathBuf;

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Specimen folder; a scene file or built-in scene such as cell-a, whose videos show its scripted
    /// grasp-lift; or an episode's folder or its episode.trocar, which is replayed.
    pub source: String,
    /// Camera: of a specimen recording or outside; of a scene its cameras (endoscope, d405, recording) or
    /// outside. The first by default.
    #[arg(long)]
    pub camera: Option<String>,
    /// Picture (.png) or video (.webp, or .mp4 by ffmpeg) to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Path tracing instead of direct light alone.
    #[arg(long)]
    pub path: bool,
    /// Paths per pixel; 64 by default.
    #[arg(long, requires = "path")]
    pub samples: Option<u32>,
    /// Width and height (px), such as 1280x720; by default the camera's own size, for videos at most 360 px
    /// high.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[usize; 2]>,
    /// Also write depth: FILE-depth.png in tenths of a millimetre, and FILE-depth-shown.png in colours.
    #[arg(long)]
    pub depth: bool,
    /// Also write the label of each pixel: FILE-labels.png.
    #[arg(long)]
    pub labels: bool,
    /// Seconds into the scripted grasp-lift of a scene (its start by default) or into an episode (its end by default).
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
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Specimen folder of an episode, if it was moved from its place in the scene.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|s| s.iter().all(|n| (8..=8192).contains(n)))
        .ok_or_else(|| "width x height, 8 to 8192 pixels each: 1280x720".to_owned())
}
