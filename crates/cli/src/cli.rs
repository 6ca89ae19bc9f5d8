//! The arguments of the command line.

mod episode;
mod evaluate;
mod export;
mod identify;
mod measure;
mod render;
mod scene;
mod specimens;
mod study;
mod task;
mod view;

pub use episode::*;
pub use evaluate::*;
pub use export::*;
pub use identify::*;
pub use measure::*;
pub use render::*;
pub use scene::*;
pub use specimens::*;
pub use study::*;
pub use task::*;
pub use trocar_studies::names::{BackName, DesignName, MesherName, SensorName, SolverName, SupportName, Units};
pub use view::*;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use trocar_scene::{BackendName, Split, TissueSource, VariationSet};

/// Trocar makes deformable organs from recordings of a surgical field, and scores robot policies on
/// them.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
    /// Print one JSON object instead of text.
    #[arg(long, global = true)]
    pub json: bool,
    /// Show no progress.
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record a phantom, reconstruct it, lift its appendix, and open the report: no downloads, no
    /// GPU.
    Demo(Demo),
    /// Make a recording with known ground truth: a procedural anatomy filmed by a simulated depth
    /// camera.
    Record(Record),
    /// Make specimens of a phantom ahead, each another anatomy, for scenes that draw from them.
    Specimens(Specimens),
    /// Describe a recording: frames, cameras, depth, organs, and what is missing.
    Inspect(Inspect),
    /// Measure grasp-lifts of a recording or an episode: lift profile, half-drop distance,
    /// landmarks.
    Measure(Measure),
    /// Identify what holds an organ and how stiff it is from the grasp-lifts of a recording: a
    /// specimen with a posterior.
    Identify(Identify),
    /// Make masks of a recording: organs by SAM 2.1 from points, instruments by the appearance of
    /// metal or followed by SAM 2.1.
    Segment(Segment),
    /// Reconstruct watertight tetrahedral organs from an RGB-D recording or a surface file.
    Reconstruct(Reconstruct),
    /// List, print, write and check scene files. A scene file describes the whole two-arm cell in
    /// TOML.
    Scene(Scene),
    /// List, print and write tasks. A task is a list of stages in a scene file, each with the
    /// condition that passes it.
    Task(Tasks),
    /// Render a picture of a specimen, a scene or an episode through one of its cameras, or a video
    /// of a scene's scripted grasp-lift or of an episode.
    Render(Render),
    /// Run a scripted grasp-lift on a specimen or in a scene, and write a report.
    Simulate(Simulate),
    /// Score policies over many episodes: a table with confidence intervals and a report. Safe to
    /// kill at any time; the same command continues.
    Evaluate(Evaluate),
    /// Run one episode of a scene's task by a policy: actions, channels, figures and a report in a
    /// folder.
    Episode(Episode),
    /// Replay a recorded episode and verify every step.
    Replay(Replay),
    /// Score stored episodes at other gates, without simulation.
    Sweep(Sweep),
    /// Write recorded episodes as a dataset of LeRobot or robomimic, rendered now and without
    /// simulation.
    Export(Export),
    /// Watch a scene, specimen, episode or campaign in the browser while it runs, and take
    /// control of the instruments.
    View(View),
    /// Reproduce a table or figure of the paper, beside the paper's numbers.
    Experiment(Experiment),
    /// Measure speed.
    Bench(Bench),
}

/// The set of factors of that name.
fn variation_set(name: &str) -> Result<VariationSet, String> {
    let known = VariationSet::ALL.map(VariationSet::name).join(", ");
    VariationSet::named(name).ok_or_else(|| format!("the sets are {known}"))
}

/// The backend of that name, for the command line.
fn backend(name: &str) -> Result<BackendName, String> {
    let known = BackendName::ALL.map(BackendName::name).join(", ");
    BackendName::named(name).ok_or_else(|| format!("the backends are {known}"))
}

/// The source of tissue of that name, for the command line.
fn tissue_source(name: &str) -> Result<TissueSource, String> {
    let known = TissueSource::ALL.map(TissueSource::name).join(", ");
    TissueSource::named(name).ok_or_else(|| format!("the sources are {known}"))
}

/// The split of that name, for the command line.
fn split(name: &str) -> Result<Split, String> {
    let known = Split::ALL.map(Split::name).join(", ");
    Split::named(name).ok_or_else(|| format!("the splits are {known}"))
}

#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for all results of the demo.
    #[arg(short, long, default_value = "trocar-demo")]
    pub output: PathBuf,
    /// Frames of the recording, at 30 Hz.
    #[arg(long, default_value_t = 46)]
    pub frames: usize,
    /// Seed of the anatomy and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Do not open the report, only print its path.
    #[arg(long)]
    pub no_open: bool,
}

#[derive(Debug, Args)]
pub struct Record {
    /// The phantom: phantom-a (rabbit: cecum, three bowel segments, stomach, appendix), phantom-b
    /// (rabbit: bowel bloc, small bowel, appendix, cecum, stomach), phantom-c (pig: liver,
    /// gallbladder), phantom-d (small liver with a folded gallbladder).
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
    /// Kind of depth noise.
    #[arg(long, value_enum, default_value_t = SensorName::Plain)]
    pub sensor: SensorName,
    /// Grasp-lifts of the appendix after these frames: 80 frames each, 11 to 38 mm. Phantoms A and
    /// B have an appendix. Their truth is in truth/lifts.toml.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub lifts: usize,
    /// What holds the lifted appendix besides its bed. The camera does not see it.
    #[arg(long, value_enum, default_value_t = SupportName::Mesentery)]
    pub support: SupportName,
}

#[derive(Debug, Args)]
pub struct Inspect {
    /// Recording: a folder with a recording.toml, a .bag or an .mcap file.
    pub recording: PathBuf,
    /// Write a template .toml and an image of the middle frame beside a .bag or .mcap file.
    #[arg(long)]
    pub template: bool,
}

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
    /// Assumed thickness of organs behind their visible fronts.
    #[arg(long, value_enum, default_value_t = BackName::Rounded)]
    pub back: BackName,
    /// Make the surface from a binary grid of 1.5 mm as in the paper, for comparison.
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

#[derive(Debug, Args)]
pub struct Simulate {
    /// Specimen folder, scene file, or built-in scene such as cell-a. In a scene, an arm of the
    /// cell does the task.
    pub specimen: PathBuf,
    /// The task.
    #[arg(long, value_enum, default_value_t = Task::GraspLift)]
    pub task: Task,
    /// Organ to grasp; by default the appendix, or the first organ without one.
    #[arg(long)]
    pub organ: Option<String>,
    /// Place of the grasp along the organ, from 0 (base) to 1 (tip); by default 0.5, or 0.7 with
    /// --sever, which needs space towards the base.
    #[arg(long, allow_negative_numbers = true)]
    pub at: Option<f64>,
    /// Lift of the jaws (mm).
    #[arg(long, default_value_t = 15.0, allow_negative_numbers = true)]
    pub lift: f64,
    /// How the jaws hold tissue; by default compliant, or the scene's design.
    #[arg(long, value_enum)]
    pub design: Option<DesignName>,
    /// Closing force of the jaws (N); by default 0.5, or the scene's force.
    #[arg(long, allow_negative_numbers = true)]
    pub jaw_force: Option<f64>,
    /// Distance of the grasp from the organ's axis, across the organ (mm).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub approach_offset: f64,
    /// Grasp first, drag the tissue sideways by this distance (mm), release it, and grasp again.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub regrasp: Option<f64>,
    /// After the hold, cut the organ between the grasp and its pins with a second instrument and
    /// lift the loose piece further; --sever=S cuts at organ coordinate S.
    #[arg(long, value_name = "S", num_args = 0..=1, require_equals = true, allow_negative_numbers = true)]
    pub sever: Option<Option<f64>>,
    /// Solver settings of the tissue; by default fast, or the scene's.
    #[arg(long, value_enum)]
    pub schedule: Option<SolverName>,
    /// Worker threads; all by default. The result does not depend on them.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder of phantoms; the scene's phantom is made there once and reused
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Run folder to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Task {
    /// Settle, grasp, lift, hold, lower, open; with --sever, cut after the hold and lift further.
    GraspLift,
}
