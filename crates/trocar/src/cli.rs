//! What a user may type.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Trocar: recordings of a surgical field become organs that deform, and policies are scored in them.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Print one JSON object for machines instead of text for people.
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress bars.
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record a phantom, reconstruct it, lift its appendix, and open the report: no downloads, no GPU.
    Demo(Demo),
    /// Make a recording with known truth: a procedural anatomy filmed by a simulated depth camera.
    Record(Record),
    /// Turn an RGB-D recording, or a ready surface, into watertight tetrahedral organs.
    Reconstruct(Reconstruct),
    /// Run a scripted task on a specimen without a window.
    Simulate(Simulate),
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for everything the demo makes.
    #[arg(short, long, default_value = "trocar-demo")]
    pub output: PathBuf,
    /// Frames of the recording.
    #[arg(long, default_value_t = 91)]
    pub frames: usize,
    /// Seed of the anatomy and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Only print the report's path, do not open it.
    #[arg(long)]
    pub no_open: bool,
}

/// Arguments of `record`.
#[derive(Debug, Args)]
pub struct Record {
    /// The phantom: phantom-a (rabbit: cecum, three bowel segments, stomach, appendix), phantom-b (rabbit: bowel bloc, small
    /// bowel, appendix, cecum, stomach), phantom-c (pig: liver, gallbladder).
    pub phantom: String,
    /// Recording folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Frames at 30 Hz.
    #[arg(long, default_value_t = 1800)]
    pub frames: usize,
    /// Seed of the anatomy and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `reconstruct`.
#[derive(Debug, Args)]
pub struct Reconstruct {
    /// Recording folder.
    #[arg(required_unless_present = "surface", conflicts_with = "surface")]
    pub recording: Option<PathBuf>,
    /// A ready surface instead of a recording: .stl, .ply or .obj.
    #[arg(long, requires = "units")]
    pub surface: Option<PathBuf>,
    /// Unit of the surface file.
    #[arg(long, value_enum)]
    pub units: Option<Units>,
    /// Specimen folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Frame at the middle of the composite's window; the middle of the recording by default.
    #[arg(long)]
    pub centre: Option<usize>,
    /// Frames on each side of the window's centre.
    #[arg(long, default_value_t = 90)]
    pub window: usize,
    /// Every how many frames of the window are used.
    #[arg(long, default_value_t = 2)]
    pub stride: usize,
}

/// Unit of lengths in a surface file.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Units {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
}

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Specimen folder.
    pub specimen: PathBuf,
    /// The task.
    #[arg(long, value_enum, default_value_t = Task::GraspLift)]
    pub task: Task,
    /// Organ to grasp; the appendix, or else the first, by default.
    #[arg(long)]
    pub organ: Option<String>,
    /// Where along the organ, 0 (base) to 1 (tip).
    #[arg(long, default_value_t = 0.5, allow_negative_numbers = true)]
    pub at: f64,
    /// Lift of the jaws [mm].
    #[arg(long, default_value_t = 15.0, allow_negative_numbers = true)]
    pub lift: f64,
    /// How a frame is cut into substeps and sweeps.
    #[arg(long, value_enum, default_value_t = ScheduleName::Default)]
    pub schedule: ScheduleName,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Run folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Tasks by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Task {
    /// Settle, grasp, lift, hold, lower, open.
    GraspLift,
}

/// Schedules by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ScheduleName {
    /// 8 substeps of 10 sweeps from the adaptive start.
    Default,
    /// 8 substeps of 10 sweeps from the inertial predictor: the paper's, with our inversion guard.
    Paper,
}
