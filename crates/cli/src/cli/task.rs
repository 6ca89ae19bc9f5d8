//! Arguments of `task`.

use clap::{Args, Subcommand};

#[derive(Debug, Args)]
pub struct Tasks {
    /// The action.
    #[command(subcommand)]
    pub action: TaskAction,
}

#[derive(Debug, Subcommand)]
pub enum TaskAction {
    /// List the built-in tasks.
    List,
    /// Print a task: a built-in task with its comments, or the stages of a scene's task.
    Show {
        /// A built-in task, a built-in scene or a scene file.
        name: String,
    },
    /// Write a commented scene with a task of your own, NAME.toml, and a policy for it, NAME.py.
    New {
        /// Name of the task: lower-case letters, digits, '-' and '_'.
        name: String,
        /// Folder to write into.
        #[arg(short, long, default_value = ".")]
        output: std::path::PathBuf,
    },
}
