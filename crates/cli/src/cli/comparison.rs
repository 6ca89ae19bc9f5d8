//! Arguments of the commands that compare integrators and settle phantoms.

use super::SolverName;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `experiment integrators`.
#[derive(Debug, Args)]
pub struct IntegratorsExperiment {
    /// Gmsh file (.msh, in metres, z up) with the organs, the lowest 42% of each pinned; phantom A, reconstructed, by default.
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Simulated time [s].
    #[arg(long, default_value_t = 1.0)]
    pub seconds: f64,
    /// Leave the tissue's dashpots out (with --mesh).
    #[arg(long, requires = "mesh")]
    pub undamped: bool,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Frames of phantom A's recording.
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomy and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for recording, specimen and report; a finished recording in it is used again.
    #[arg(short, long, default_value = "trocar-experiment/integrators")]
    pub output: PathBuf,
}

/// Arguments of `experiment settling`.
#[derive(Debug, Args)]
pub struct SettlingExperiment {
    /// Phantoms; all by default.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// What steps them.
    #[arg(long, value_enum, default_value_t = SolverName::Fast)]
    pub schedule: SolverName,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Frames of each recording.
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomies and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for recordings, specimens and report; finished recordings in it are used again.
    #[arg(short, long, default_value = "trocar-experiment/settling")]
    pub output: PathBuf,
}

/// Arguments of `experiment random-actions`.
#[derive(Debug, Args)]
pub struct RandomActionsExperiment {
    /// Scene file or built-in scene.
    #[arg(default_value = "cell-a")]
    pub scene: String,
    /// First seed; every fourth (3, 7, ...) moves the tips, the others ask for coordinates in the ports.
    #[arg(long, default_value_t = 0)]
    pub first_seed: u64,
    /// Number of seeds.
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Actions a seed.
    #[arg(long, default_value_t = 500)]
    pub actions: usize,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Seeds that are run at once; as many as there are threads by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder for trials and report; finished seeds in it are not run again.
    #[arg(short, long, default_value = "trocar-experiment/random-actions")]
    pub output: PathBuf,
}
