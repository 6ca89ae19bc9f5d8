//! Arguments of `view`.

use clap::Args;
use std::path::PathBuf;
use trocar_scene::VariationSet;

#[derive(Debug, Args)]
pub struct View {
    /// Scene file or built-in scene such as cell-a; a specimen's folder; an episode's file or
    /// folder; a folder of a campaign or of demonstrations.
    pub source: String,
    /// Who acts: operator (the arms hold their place until an operator moves them), scripted,
    /// noise, delay, offset, greedy, random; ws://HOST:PORT or python:... as for episode.
    #[arg(long, default_value = "scripted")]
    pub policy: String,
    /// Seed of the first episode.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// What is drawn by the seed, instead of the scene's set: none, easy, standard or hard.
    #[arg(long, value_name = "SET", value_parser = super::variation_set)]
    pub variation: Option<VariationSet>,
    /// Port on this machine; 0 for a free one.
    #[arg(long, default_value_t = 8787)]
    pub port: u16,
    /// Folder of demonstrations. An episode that is kept is written there; nothing is kept by
    /// default.
    #[arg(long, value_name = "FOLDER")]
    pub record: Option<PathBuf>,
    /// Simulated over wall time, 0.125 to 8; 0 for as fast as it goes.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub speed: f64,
    /// Begin paused.
    #[arg(long)]
    pub paused: bool,
    /// Do not open the page, only print its address.
    #[arg(long)]
    pub no_open: bool,
    /// End at the end of the standard input, so that the program ends with the one that started it.
    #[arg(long)]
    pub until_eof: bool,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}
