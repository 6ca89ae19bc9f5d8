//! The arguments of the command line.

mod comparison;
mod episode;
mod evaluate;
mod grasp;
mod port;
mod render;
mod scene;
mod solver;

pub use comparison::*;
pub use episode::*;
pub use evaluate::*;
pub use grasp::*;
pub use port::*;
pub use render::*;
pub use scene::*;
pub use solver::*;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Trocar: recordings of a surgical field become organs that deform, and policies are scored in them.
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

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record a phantom, reconstruct it, lift its appendix, and open the report: no downloads, no GPU.
    Demo(Demo),
    /// Make a recording with known ground truth: a procedural anatomy filmed by a simulated depth camera.
    Record(Record),
    /// Describe a recording: frames, cameras, depth, organs, and what is missing.
    Inspect(Inspect),
    /// Make masks of a recording: organs by SAM 2.1 from points, instruments by the appearance of
    /// metal or followed by SAM 2.1.
    Segment(Segment),
    /// Reconstruct watertight tetrahedral organs from an RGB-D recording or a surface file.
    Reconstruct(Reconstruct),
    /// List, print, write and check scene files. A scene file describes the whole two-arm cell in TOML.
    Scene(Scene),
    /// Render a picture of a specimen, a scene or an episode through one of its cameras, or a video of
    /// a scene's scripted grasp-lift or of an episode.
    Render(Render),
    /// Run a scripted grasp-lift on a specimen or in a scene, and write a report.
    Simulate(Simulate),
    /// Score policies over many episodes: a table with confidence intervals and a report. Safe to kill at
    /// any time; the same command continues.
    Evaluate(Evaluate),
    /// Run one episode of a scene's task by a policy: actions, channels, figures and a report in a folder.
    Episode(Episode),
    /// Replay a recorded episode and verify every step.
    Replay(Replay),
    /// Score stored episodes at other gates, without simulation.
    Sweep(Sweep),
    /// Reproduce a table or figure of the paper, beside the paper's numbers.
    Experiment(Experiment),
    /// Measure speed.
    Bench(Bench),
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for all results of the demo.
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
    /// Do not open the report, only print its path.
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
    /// Kind of depth noise.
    #[arg(long, value_enum, default_value_t = SensorName::Plain)]
    pub sensor: SensorName,
}

/// Kinds of depth noise by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SensorName {
    /// Independent from pixel to pixel and frame to frame.
    Plain,
    /// Also that of stereo matching: smooth over several pixels, changing slowly, with fattened silhouettes.
    Stereo,
}

impl From<SensorName> for trocar_phantom::Sensor {
    fn from(name: SensorName) -> Self {
        match name {
            SensorName::Plain => Self::Plain,
            SensorName::Stereo => Self::Stereo,
        }
    }
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

/// Arguments of `experiment`.
#[derive(Debug, Args)]
pub struct Experiment {
    /// Which one.
    #[command(subcommand)]
    pub name: ExperimentName,
}

/// Experiments by name.
#[derive(Debug, Subcommand)]
pub enum ExperimentName {
    /// Table I and Fig. 6(a): every phantom recorded, reconstructed and measured against its truth.
    Reconstruction(ReconstructionExperiment),
    /// How near each iteration comes to the exact step: scenes, moduli and Poisson ratios, over iterations and over time.
    Convergence(ConvergenceExperiment),
    /// Fig. 6(b): which integrators stay bounded when specimen A is released, and how far each sags from the truth.
    Integrators(IntegratorsExperiment),
    /// Fig. 6(c): how fast phantoms A, B and C come to rest in the cell.
    Settling(SettlingExperiment),
    /// Table II and Fig. 7(a) to (c): four ways to hold the appendix, at five places and from three sides, and again after a drag.
    GraspDesigns(GraspDesignsExperiment),
    /// Fig. 7(f): whether elements invert when the appendix is lifted 15 and 30 mm, at five moduli and with two pin rules.
    ElementQuality(ElementQualityExperiment),
    /// Fig. 5: how far a shaft may lie beside its port's centre at each tilt, by the formula and by the contact model.
    PortBudget(PortBudgetExperiment),
    /// The arms' controller chosen out of 182 configurations: RCM deviation, tracking and droop under a wrong model and friction.
    ControllerGrid(ControllerGridExperiment),
    /// The instrument weighed in 54 noisy poses, many times over; and a touch of tens of millinewtons after the tare.
    Wrench(WrenchExperiment),
    /// Random but legal actions in a scene's cell: whether tissue or arms break.
    RandomActions(RandomActionsExperiment),
    /// Fig. 6(d, e): 140 rollouts of six controllers; killed at any moment and gone on with.
    Rollouts(RolloutsExperiment),
    /// Silhouettes, SSIM and PSNR of rendered reconstructions beside what was filmed, and oblique views through the endoscope.
    Similarity(SimilarityExperiment),
}

/// Arguments of `experiment similarity`.
#[derive(Debug, Args)]
pub struct SimilarityExperiment {
    /// Folder for recordings, specimens, pictures and the report; finished recordings in it are used again.
    #[arg(short, long, default_value = "trocar-experiment/similarity")]
    pub output: PathBuf,
    /// Phantoms; all by default. The first is filmed from the side too.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// Frames of each recording (the composite's window holds 181; the paper recorded 1,790).
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomies and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder with the real recordings; what it lacks is left out.
    #[arg(long, value_name = "FOLDER", default_value = "../shared/data")]
    pub data: PathBuf,
    /// Paths a pixel.
    #[arg(long, default_value_t = 16)]
    pub samples: u32,
}

/// Arguments of `experiment reconstruction`.
#[derive(Debug, Args)]
pub struct ReconstructionExperiment {
    /// Folder for recordings, specimens and the report; finished recordings in it are used again.
    #[arg(short, long, default_value = "trocar-experiment/reconstruction")]
    pub output: PathBuf,
    /// Phantoms; all by default.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// Frames of each recording (the composite's window holds 181; the paper recorded 1,790).
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomies and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What kind of noise depth has.
    #[arg(long, value_enum, default_value_t = SensorName::Plain)]
    pub sensor: SensorName,
    /// How thick organs are taken to be behind their fronts.
    #[arg(long, value_enum, default_value_t = BackName::Rounded)]
    pub back: BackName,
    /// What fills the surfaces with tetrahedra.
    #[arg(long, value_enum, default_value_t = MesherName::Lattice)]
    pub mesher: MesherName,
}

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct Bench {
    /// Which one.
    #[command(subcommand)]
    pub name: BenchName,
}

/// Benchmarks by name.
#[derive(Debug, Subcommand)]
pub enum BenchName {
    /// The lattice mesher from ten thousand to a million elements, and beside TetGen and fTetWild.
    Meshing(MeshingBench),
    /// Speed and error of the stepping of six organs by one schedule.
    Organs(OrgansBench),
    /// Speed of the stepping from a thousand to a million elements, over threads, and of many small models at once.
    Scaling(ScalingBench),
    /// What contact with the gripper costs in a grasp-lift of all organs.
    Grasp(GraspBench),
    /// Speed of the whole two-arm cell, and what its parts cost.
    Cell(CellBench),
    /// Speed of a whole scripted episode with arms, organs and two cameras, and what its parts cost.
    Episode(EpisodeBench),
    /// What pictures cost: a preview for policies, a path-traced frame, rays beside Embree.
    Render(RenderBench),
}

/// Arguments of `bench cell`.
#[derive(Debug, Args)]
pub struct CellBench {
    /// Scene file or built-in scene.
    #[arg(default_value = "cell-a")]
    pub scene: String,
    /// A specimen folder instead of the scene's specimen.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Arguments of `bench episode`.
#[derive(Debug, Args)]
pub struct EpisodeBench {
    /// Scene file or built-in scene.
    #[arg(default_value = "cell-a")]
    pub scene: String,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
    /// Worker threads for tissue; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Times that the episode is run; the median counts.
    #[arg(long, default_value_t = 3)]
    pub runs: usize,
    /// Seed of the episode.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// A camera that looks once a control period; the endoscope and the depth camera by default. Several are named by several.
    #[arg(long = "camera", value_name = "NAME", default_values_t = ["endoscope".to_owned(), "d405".to_owned()])]
    pub cameras: Vec<String>,
    /// Side of the square pictures [px].
    #[arg(long, default_value_t = 224)]
    pub size: usize,
}

/// Arguments of `bench meshing`.
#[derive(Debug, Args)]
pub struct MeshingBench {
    /// Closed surfaces (.stl, .ply, .obj); an ellipsoid of a liver's size by default. The first is the one meshed finer and finer.
    pub surfaces: Vec<PathBuf>,
    /// Unit of the surface files.
    #[arg(long, value_enum, default_value_t = Units::Mm)]
    pub units: Units,
    /// Numbers of elements to aim at.
    #[arg(long, value_delimiter = ',', default_values_t = [10_000, 30_000, 100_000, 300_000, 1_000_000])]
    pub sizes: Vec<usize>,
    /// Python that has the package pytetwild.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// Folder for the report.
    #[arg(short, long, default_value = "trocar-bench/meshing")]
    pub output: PathBuf,
}

/// Arguments of `bench render`.
#[derive(Debug, Args)]
pub struct RenderBench {
    /// Triangles of the organs, about; a fifth of them deform.
    #[arg(long, default_value_t = 100_000)]
    pub triangles: usize,
    /// Paths a pixel of the large picture; 0 leaves it out.
    #[arg(long, default_value_t = 64)]
    pub samples: u32,
    /// Side of the square image of rays that are cast beside Embree.
    #[arg(long, default_value_t = 1024)]
    pub rays: usize,
    /// Python that has the package embreex.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// Where to write the large picture (PNG).
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// Scene file or built-in scene whose cameras are measured; none for none.
    #[arg(long, default_value = "cell-a")]
    pub scene: String,
    /// Folder of made phantoms, where the scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}

/// Models of the unseen back by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum BackName {
    /// As round as the silhouette is wide, as in the paper. Flat organs become too thick.
    Rounded,
    /// As high as the front rises above its rim, and the same below.
    Fitted,
}

impl From<BackName> for trocar_reconstruct::BackRule {
    fn from(name: BackName) -> Self {
        match name {
            BackName::Rounded => Self::Rounded,
            BackName::Fitted => Self::Fitted,
        }
    }
}

/// Meshers by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum MesherName {
    /// Isosurface stuffing: no slivers, fine at the surface, coarse inside.
    Lattice,
    /// The TetGen program at the paper's settings (Debian: apt install tetgen).
    Tetgen,
}

impl From<MesherName> for trocar_reconstruct::MesherRule {
    fn from(name: MesherName) -> Self {
        match name {
            MesherName::Lattice => Self::Lattice,
            MesherName::Tetgen => Self::Tetgen,
        }
    }
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

impl From<Units> for trocar_geometry::io::Unit {
    fn from(units: Units) -> Self {
        match units {
            Units::Mm => Self::Millimetre,
            Units::Cm => Self::Centimetre,
            Units::M => Self::Metre,
        }
    }
}

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Specimen folder; or a scene file or built-in scene such as cell-a, where the left arm of the cell
    /// does the same task.
    pub specimen: PathBuf,
    /// The task.
    #[arg(long, value_enum, default_value_t = Task::GraspLift)]
    pub task: Task,
    /// Organ to grasp; by default the appendix, or the first organ without one.
    #[arg(long)]
    pub organ: Option<String>,
    /// Place of the grasp along the organ, from 0 (base) to 1 (tip); by default 0.5, or 0.7 with --sever,
    /// which needs room on the base's side.
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
    /// First grasp, drag the tissue sideways by this distance (mm), let go, and grasp again.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub regrasp: Option<f64>,
    /// After the hold, cut the organ between the grasp and its pins with a second instrument and lift the
    /// loose piece further; --sever=S cuts at organ coordinate S.
    #[arg(long, value_name = "S", num_args = 0..=1, require_equals = true, allow_negative_numbers = true)]
    pub sever: Option<Option<f64>>,
    /// Solver settings of the tissue; by default fast, or the scene's.
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
    /// Settle, grasp, lift, hold, lower, open; with --sever cut after the hold and lift further.
    GraspLift,
}
