//! Arguments of `evaluate`.

use clap::Args;
use std::path::PathBuf;
use trocar_scene::{BackendName, Split, TissueSource, VariationSet};

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
    /// Number of the first episode in the split; the following episodes have the following
    /// numbers. A seen episode's seed is its number, an unseen one's is 1000000 more. All policies
    /// have the same seeds.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Episodes to train on (seen), episodes that are kept apart, with anatomies of their own
    /// (unseen), or both in turn.
    #[arg(long, value_name = "SPLIT", value_parser = super::split, default_value = "seen")]
    pub split: Split,
    /// What varies between episodes: none, easy, standard or hard. By default the set of the scene,
    /// or standard if it has none. Factors that the scene itself names vary as it says. The first
    /// run makes the anatomies of the set, about a minute each.
    #[arg(long, value_name = "SET", value_parser = super::variation_set)]
    pub variation: Option<VariationSet>,
    /// Support and tissue of organs: those of the specimen and the scene (specimen), or drawn for
    /// each episode from what `trocar identify` wrote into the specimen (posterior); what the scene
    /// says by default.
    #[arg(long, value_name = "SOURCE", value_parser = super::tissue_source)]
    pub tissue: Option<TissueSource>,
    /// The model of the tissue: tetrahedra (tets) or lattice; the scene's by default. Given twice,
    /// the campaign runs on both, in a folder each, and a page tells whether they rank policies
    /// alike.
    #[arg(long = "backend", value_name = "BACKEND", value_parser = super::backend)]
    pub backends: Vec<BackendName>,
    /// Show success by these in the terminal, separated by commas: factors (modulus_kpa), groups
    /// (organ, tissue, place, start, setup, tool, camera, light, modulus), drawn numbers
    /// (left.tilt_deg), split, or all. Page and JSON have them too, or all that varies by default.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Episodes at once, up to eight per core; by default one per core. The result does not depend
    /// on it.
    #[arg(long, default_value_t = 0)]
    pub jobs: usize,
    /// Run episodes again in which the policy failed.
    #[arg(long)]
    pub retry_failed: bool,
    /// Keep what pictures are made of at every control period (surfaces.trocar), so that `trocar
    /// export` renders later without simulation.
    #[arg(long)]
    pub surfaces: bool,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Campaign folder; an unfinished campaign in it continues.
    #[arg(short, long, visible_alias = "resume", value_name = "FOLDER", default_value = "trocar-campaign")]
    pub output: PathBuf,
}
