//! Arguments of `trocar measure`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct Measure {
    /// Recording whose recording.toml marks lifts by [[lift]], or the folder of an episode.
    pub source: PathBuf,
    /// Camera of an episode; by default its scene's first.
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Frame of an episode in which the tissue lies still; by default its first.
    #[arg(long, value_name = "FRAME")]
    pub rest: Option<usize>,
    /// First frame of an episode's lift; by default the one after --rest.
    #[arg(long, value_name = "FRAME")]
    pub first: Option<usize>,
    /// Last frame of an episode's lift; by default its last.
    #[arg(long, value_name = "FRAME")]
    pub last: Option<usize>,
    /// Pixel on the organ in an episode's frame --rest; by default in the organ's middle.
    #[arg(long, value_name = "U,V", value_delimiter = ',', num_args = 2)]
    pub click: Option<Vec<f64>>,
    /// Film of a lift to write (.webp), with landmarks, plane, grasp and lift profile drawn in.
    #[arg(long, value_name = "FILE")]
    pub film: Option<PathBuf>,
    /// Number of the lift that --film shows, from 0.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, requires = "film")]
    pub lift: usize,
    /// Specimen folder of an episode, if it was moved from its place in the scene.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}
