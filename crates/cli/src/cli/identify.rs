//! Arguments of `trocar identify`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct Identify {
    /// Recording whose recording.toml marks lifts by [[lift]].
    pub recording: PathBuf,
    /// Specimen folder to write: the reconstructed organs, what was identified, and a page.
    #[arg(short, long, value_name = "FOLDER", default_value = "trocar-identified")]
    pub output: PathBuf,
    /// A specimen that was reconstructed from the recording before; by default it is reconstructed
    /// now.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// The lifted organ; by default that of the first lift.
    #[arg(long, value_name = "NAME")]
    pub organ: Option<String>,
    /// Numbers of the lifts to use, separated by commas, from 0; by default all.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub lifts: Vec<usize>,
    /// Cells of the mesh in which lifts are simulated (mm).
    #[arg(long, value_name = "MM", default_value_t = 4.0)]
    pub cell: f64,
    /// Seed of the draws.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Worker threads; all by default. The result does not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}
