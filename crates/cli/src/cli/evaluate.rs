//! Arguments of `evaluate`.

use clap::Args;
use std::path::PathBuf;
use trocar_scene::VariationSet;

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
pub struct Evaluate {
    /// Scene file, or a built-in scene such as cell-a.
    pub scene: String,
    /// A policy: scripted, noise, delay, offset, greedy, random; ws://HOST:PORT for an openpi
    /// server; python:FILE.py:NAME or python:MODULE:NAME for a Python callable. NAME=... names it.
    /// Several policies are compared.
    #[arg(long = "policy", value_name = "POLICY", default_value = "scripted")]
    pub policies: Vec<String>,
    /// Episodes of each policy.
    #[arg(long, default_value_t = 15)]
    pub episodes: usize,
    /// Seed of the first episode; the following episodes have the following seeds. All policies
    /// have the same seeds.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// What varies between episodes, instead of the scene's set: none, easy, standard or hard.
    /// Factors that the scene itself names vary as it says.
    #[arg(long, value_name = "SET", value_parser = super::variation_set)]
    pub variation: Option<VariationSet>,
    /// Episodes at once, up to eight per core; by default one per core. The result does not depend
    /// on it.
    #[arg(long, default_value_t = 0)]
    pub jobs: usize,
    /// Run episodes again in which the policy failed.
    #[arg(long)]
    pub retry_failed: bool,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Campaign folder; an unfinished campaign in it continues.
    #[arg(short, long, visible_alias = "resume", value_name = "FOLDER", default_value = "trocar-campaign")]
    pub output: PathBuf,
}
