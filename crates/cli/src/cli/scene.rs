//! Arguments of `scene`.

use clap::{Args, Subcommand};

/// Arguments of `scene`.
#[derive(Debug, Args)]
pub struct Scene {
    /// What to do.
    #[command(subcommand)]
    pub action: SceneAction,
}

/// What can be done with scenes.
#[derive(Debug, Subcommand)]
pub enum SceneAction {
    /// The scenes that come with the program.
    List,
    /// Print a scene: a built-in one with its comments, to start from, or a file with every value that it leaves out.
    Show {
        /// A built-in scene, or a scene file.
        name: String,
        /// Print a built-in scene, too, in the form in which replays know it: every value, a fixed order, no comments.
        #[arg(long)]
        canonical: bool,
    },
    /// Write a scene file for a specimen: the paper's cell with the specimen placed so that both tools reach its organ.
    New {
        /// Specimen folder.
        specimen: std::path::PathBuf,
        /// Organ of the task; the appendix, or else the first, by default.
        #[arg(long)]
        organ: Option<String>,
        /// Scene file to write; printed by default.
        #[arg(short, long)]
        output: Option<std::path::PathBuf>,
    },
    /// Say whether a scene file is in order, or else what is wrong, where, and what would be right.
    Check {
        /// A scene file, or a built-in scene.
        file: String,
    },
    /// Print the JSON schema of scene files, for editors.
    Schema,
}
