//! Arguments of `episode`, `replay` and `sweep`.

use clap::Args;
use std::path::PathBuf;
use trocar_scene::VariationSet;

#[derive(Debug, Args)]
pub struct Episode {
    /// Scene file, or a built-in scene such as cell-a.
    pub scene: String,
    /// The policy: scripted, noise, delay, offset, greedy, random; ws://HOST:PORT for an openpi
    /// server; python:FILE.py:NAME or python:MODULE:NAME for a Python callable. NAME=... names it.
    #[arg(long, default_value = "scripted")]
    pub policy: String,
    /// Seed of the start and of the policy's random numbers.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// What is drawn by the seed, instead of the scene's set: none, easy, standard or hard. By
    /// default as the scene says. Factors that the scene itself names vary as it says.
    #[arg(long, value_name = "SET", value_parser = super::variation_set)]
    pub variation: Option<VariationSet>,
    /// Keep what pictures are made of at every control period (surfaces.trocar), so that `trocar
    /// export` renders later without simulation.
    #[arg(long)]
    pub surfaces: bool,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Episode folder to write: episode.trocar, channels.parquet, result.json, report.html.
    #[arg(short, long)]
    pub output: PathBuf,
}

#[derive(Debug, Args)]
pub struct Replay {
    /// Episode folder, or its episode.trocar.
    pub file: PathBuf,
    /// Replay the episode and compare the state after every step.
    #[arg(long)]
    pub verify: bool,
    /// Specimen folder, if it was moved from its place in the scene.
    #[arg(long, value_name = "FOLDER", requires = "verify")]
    pub specimen: Option<PathBuf>,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}

#[derive(Debug, Args)]
pub struct Sweep {
    /// Episode folders, or their channels.parquet files.
    #[arg(required = true)]
    pub channels: Vec<PathBuf>,
    /// A gate and its values: lift_mm=4..12 (nine values), lift_mm=4..12:0.5 or
    /// cut_closed=0.15,0.3. Several gates give every combination.
    #[arg(long = "gate", value_name = "NAME=VALUES", required = true)]
    pub gates: Vec<String>,
}
