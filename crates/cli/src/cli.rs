//! What a user may type.

mod episode;
mod evaluate;
mod render;
mod scene;
mod study;

pub use episode::*;
pub use evaluate::*;
pub use render::*;
pub use scene::*;
pub use study::*;
pub use trocar_studies::names::{BackName, DesignName, MesherName, SensorName, SolverName, Units};

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
    /// Describe a recording: frames, cameras, depth, organs, and what is missing.
    Inspect(Inspect),
    /// Make masks of a recording: organs by SAM 2.1 from points, instruments by the appearance of
    /// metal or followed by SAM 2.1.
    Segment(Segment),
    /// Reconstruct watertight tetrahedral organs from an RGB-D recording or a surface file.
    Reconstruct(Reconstruct),
    /// List, print and check scene files: the whole two-arm cell in one TOML file.
    Scene(Scene),
    /// Make a picture of a specimen, a scene or an episode through one of its cameras, or a moving one of the scene's grasp-lift or of the episode.
    Render(Render),
    /// Run a scripted task on a specimen without a window.
    Simulate(Simulate),
    /// Scores policies over many episodes: a table with intervals and a report; killed at any moment and gone on with.
    Evaluate(Evaluate),
    /// Run one episode of a scene's task by a policy, into a folder.
    Episode(Episode),
    /// Do a recorded episode again and compare every step.
    Replay(Replay),
    /// Judge stored episodes at other gates, without simulating.
    Sweep(Sweep),
    /// Make a table or figure of the paper anew, beside the paper's numbers.
    Experiment(Experiment),
    /// Measure what something costs.
    Bench(Bench),
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
    /// What kind of noise depth has.
    #[arg(long, value_enum, default_value_t = SensorName::Plain)]
    pub sensor: SensorName,
}

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// Recording: a folder with a recording.toml, a .bag or an .mcap file.
    pub recording: PathBuf,
    /// Write a template .toml and an image of the middle frame beside a .bag or .mcap file.
    #[arg(long)]
    pub template: bool,
}

/// Arguments of `segment`.
#[derive(Debug, Args)]
pub struct Segment {
    /// Recording; its .toml marks organs by `points` and instruments by `[[instrument]]`.
    #[arg(required_unless_present = "weights")]
    pub recording: Option<PathBuf>,
    /// Folder to write. `reconstruct` reads it as masks/ in the recording.
    #[arg(short, long, required_unless_present = "weights")]
    pub output: Option<PathBuf>,
    /// List the files that SAM 2.1 needs, whether they are present, and how to get the others.
    #[arg(long)]
    pub weights: bool,
    #[command(flatten)]
    pub sam: Sam,
}

/// The files of SAM 2.1.
#[derive(Debug, Args)]
pub struct Sam {
    /// Folder with the ONNX networks of SAM 2.1 (`trocar segment --weights` lists them).
    #[arg(long = "sam", value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
    /// ONNX Runtime's library, or a folder with a Python onnxruntime; the variable ORT_DYLIB_PATH
    /// has priority.
    #[arg(long, value_name = "PATH")]
    pub onnxruntime: Option<PathBuf>,
}

/// Arguments of `reconstruct`.
#[derive(Debug, Args)]
pub struct Reconstruct {
    /// Recording: a folder with a recording.toml, or a .bag or .mcap file with an optional .toml of
    /// the same name.
    #[arg(required_unless_present = "surface", conflicts_with = "surface")]
    pub recording: Option<PathBuf>,
    /// A surface file instead of a recording: .stl, .ply or .obj.
    #[arg(long, requires = "units")]
    pub surface: Option<PathBuf>,
    /// Unit of the surface file.
    #[arg(long, value_enum, conflicts_with = "recording")]
    pub units: Option<Units>,
    /// Specimen folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Frame at the centre of the composite's window; by default the middle of the recording.
    #[arg(long)]
    pub centre: Option<usize>,
    /// Frames on each side of the window's centre; choose fewer where tissue moves.
    #[arg(long, default_value_t = 90)]
    pub window: usize,
    /// Step between the used frames of the window.
    #[arg(long, default_value_t = 2)]
    pub stride: usize,
    /// SAM 2.1, for organs that have only points.
    #[command(flatten)]
    pub sam: Sam,
    /// How thick organs are taken to be behind their fronts.
    #[arg(long, value_enum, default_value_t = BackName::Rounded)]
    pub back: BackName,
    /// Make the surface from a binary grid of 1.5 mm, as the paper does, for comparison.
    #[arg(long)]
    pub binary_grid: bool,
    /// The mesher that fills the surface with tetrahedra.
    #[arg(long, value_enum, default_value_t = MesherName::Lattice)]
    pub mesher: MesherName,
    /// Edge of the elements at the surface (mm); by default 2.2, or larger where an organ would get
    /// more than 50,000.
    #[arg(long, allow_negative_numbers = true)]
    pub element_size: Option<f64>,
}

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Specimen folder; or a scene file or built-in scene such as cell-a, for the same task by the left arm of the two-arm cell.
    pub specimen: PathBuf,
    /// The task.
    #[arg(long, value_enum, default_value_t = Task::GraspLift)]
    pub task: Task,
    /// Organ to grasp; the appendix, or else the first, by default.
    #[arg(long)]
    pub organ: Option<String>,
    /// Where along the organ, 0 (base) to 1 (tip); 0.5 by default, and 0.7 with --sever, which needs room on the base's side.
    #[arg(long, allow_negative_numbers = true)]
    pub at: Option<f64>,
    /// Lift of the jaws [mm].
    #[arg(long, default_value_t = 15.0, allow_negative_numbers = true)]
    pub lift: f64,
    /// How the jaws hold; compliant, or as the scene says.
    #[arg(long, value_enum)]
    pub design: Option<DesignName>,
    /// Force with which the jaws close [N]; 0.5, or as the scene says.
    #[arg(long, allow_negative_numbers = true)]
    pub jaw_force: Option<f64>,
    /// How far beside the organ's middle the gripper comes [mm], across the organ.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub approach_offset: f64,
    /// First drag the tissue sideways by this much [mm], let go, and grasp again.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub regrasp: Option<f64>,
    /// After the hold, cut the organ between the grasp and its pins with a second instrument and lift on what comes loose; --sever=S cuts at organ coordinate S.
    #[arg(long, value_name = "S", num_args = 0..=1, require_equals = true, allow_negative_numbers = true)]
    pub sever: Option<Option<f64>>,
    /// What steps the organs; fast by default. A scene says it itself.
    #[arg(long, value_enum)]
    pub schedule: Option<SolverName>,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Run folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Tasks by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Task {
    /// Settle, grasp, lift, hold, lower, open; with --sever cut and lift on after the hold.
    GraspLift,
}
