//! Arguments of `export`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct Export {
    /// Episode folders, campaign folders, or folders of such.
    #[arg(required = true)]
    pub sources: Vec<PathBuf>,
    /// What to write: a folder for lerobot, an .hdf5 file for robomimic, a .glb file for gltf.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Layout of the dataset, or gltf: one episode as an animated scene for other programs.
    #[arg(long, value_enum, default_value_t = Layout::Lerobot)]
    pub format: Layout,
    /// Cameras of the scene; by default all but recording. "none" writes no pictures.
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub cameras: Vec<String>,
    /// Width and height of all pictures (px), such as 224x224; by default each camera's
    /// policy_size_px.
    #[arg(long, value_name = "WxH", value_parser = super::size)]
    pub size: Option<[usize; 2]>,
    /// Moments of a glTF file, from 2 to 64, evenly spaced over the episode.
    #[arg(long, value_name = "COUNT", default_value_t = trocar_workflow::MAX_KEYFRAMES)]
    pub keyframes: usize,
    /// Also episodes that did not pass.
    #[arg(long)]
    pub all: bool,
    /// Light, exposure, gloss and tint of the scene, instead of those drawn for each episode.
    #[arg(long)]
    pub plain_light: bool,
    /// Specimen folder, if it was moved from its place in the scene.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Layout {
    /// LeRobot's dataset v3.0, with videos.
    Lerobot,
    /// robomimic's HDF5 file.
    Robomimic,
    /// A binary glTF file of one episode.
    Gltf,
}
