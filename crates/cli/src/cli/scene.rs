//! Arguments of `scene`.

use clap::{Args, Subcommand};

#[derive(Debug, Args)]
pub struct Scene {
    /// The action.
    #[command(subcommand)]
    pub action: SceneAction,
}

#[derive(Debug, Subcommand)]
pub enum SceneAction {
    /// List the built-in scenes.
    List,
    /// Print a scene: a built-in scene with its comments, or a file with all default values.
    Show {
        /// A built-in scene, or a scene file.
        name: String,
        /// Print a built-in scene in the form of replays: all values, in fixed order, without
        /// comments.
        #[arg(long)]
        canonical: bool,
    },
    /// Write a scene file for a specimen: the paper's cell, with the specimen placed within reach
    /// of both tools.
    New {
        /// Specimen folder.
        specimen: std::path::PathBuf,
        /// Organ of the task; by default the appendix, or the first organ without one.
        #[arg(long)]
        organ: Option<String>,
        /// Scene file to write; by default the scene is printed.
        #[arg(short, long)]
        output: Option<std::path::PathBuf>,
    },
    /// Check a scene file and whether the tools reach the task's organ. Prints the first mistake
    /// with its line and a correction.
    Check {
        /// A scene file, or a built-in scene.
        file: String,
    },
    /// Print the JSON schema of scene files, for editors.
    Schema,
}
