//! Arguments of `specimens`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct Specimens {
    /// The phantom: phantom-a, phantom-b, phantom-c or phantom-d.
    pub phantom: String,
    /// Number of anatomies; each has the seed after the one before.
    #[arg(long, default_value_t = 8)]
    pub count: u32,
    /// Seed of the first anatomy.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u32,
    /// Approximate largest number of elements of an organ, as `specimen.max_elements` in a scene
    #[arg(long, value_name = "NUMBER")]
    pub max_elements: Option<u32>,
    /// Folder of phantoms
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}
