//! Arguments of the commands that measure the stepping of tissue.

use clap::{Args, ValueEnum};
use std::path::PathBuf;
use trocar_studies::OrganSource;

/// Which organs.
#[derive(Debug, Args)]
pub struct OrganChoice {
    /// Gmsh file (.msh, in metres, z up) with the organs, one a physical group or connected part; our own organs by default.
    #[arg(long, value_name = "FILE", conflicts_with = "tets")]
    pub mesh: Option<PathBuf>,
    /// Elements of our own organs together, about.
    #[arg(long, default_value_t = 44_000)]
    pub tets: usize,
}

impl From<&OrganChoice> for OrganSource {
    fn from(choice: &OrganChoice) -> Self {
        choice.mesh.clone().map_or(Self::Analytic(choice.tets), Self::File)
    }
}

/// Solvers by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SolverName {
    /// Vertex Block Descent, 8 substeps of 10 sweeps from the inertial predictor: the paper's.
    Paper,
    /// The warped, prefactored quasi-Newton method.
    Fast,
    /// The paper's sweeps from the adaptive start.
    Adaptive,
}

impl SolverName {
    /// The schedule of a scene of this name.
    pub fn schedule(&self) -> trocar_scene::ScheduleName {
        match self {
            Self::Paper => trocar_scene::ScheduleName::Paper,
            Self::Fast => trocar_scene::ScheduleName::Fast,
            Self::Adaptive => trocar_scene::ScheduleName::Adaptive,
        }
    }

    /// The name by which the work knows it.
    pub fn name(self) -> String {
        match self {
            Self::Paper => "paper",
            Self::Fast => "fast",
            Self::Adaptive => "adaptive",
        }
        .to_owned()
    }
}

/// Arguments of `bench organs`.
#[derive(Debug, Args)]
pub struct OrgansBench {
    #[command(flatten)]
    pub organs: OrganChoice,
    /// What steps them.
    #[arg(long, value_enum, default_value_t = SolverName::Fast)]
    pub schedule: SolverName,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Young's modulus [kPa].
    #[arg(long, default_value_t = 12.0)]
    pub young: f64,
    /// Poisson's ratio.
    #[arg(long, default_value_t = 0.45)]
    pub poisson: f64,
    /// Damp the tissue as in the cell while it is timed and judged, too; the peers have no damping.
    #[arg(long)]
    pub damped: bool,
    /// Timed frames, after a quarter as many that are not.
    #[arg(long, default_value_t = 120)]
    pub frames: usize,
    /// Simulated seconds for which the organs settle before their sag is measured.
    #[arg(long, default_value_t = 3.0)]
    pub settle: f64,
}

/// Arguments of `bench scaling`.
#[derive(Debug, Args)]
pub struct ScalingBench {
    /// Numbers of elements to aim at, ascending.
    #[arg(long, value_delimiter = ',', default_values_t = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000])]
    pub sizes: Vec<usize>,
    /// Numbers of worker threads.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2])]
    pub threads: Vec<usize>,
    /// Seconds that one measurement may take; what is expected to take longer is left out.
    #[arg(long, default_value_t = 20.0)]
    pub budget: f64,
    /// Small models stepped at once; 0 for none.
    #[arg(long, default_value_t = 64)]
    pub many: usize,
    /// Elements of each of them, about.
    #[arg(long, default_value_t = 700)]
    pub small: usize,
    /// Folder for the report.
    #[arg(short, long, default_value = "trocar-bench/scaling")]
    pub output: PathBuf,
}

/// Arguments of `experiment convergence`.
#[derive(Debug, Args)]
pub struct ConvergenceExperiment {
    /// Folder for the report; finished cases in it are kept and used again.
    #[arg(short, long, default_value = "trocar-experiment/convergence")]
    pub output: PathBuf,
    /// Gmsh file (.msh, in metres, z up) with organs, of which the appendix is used; our own appendix by default.
    #[arg(long, value_name = "FILE", conflicts_with = "tets")]
    pub mesh: Option<PathBuf>,
    /// Elements of our own appendix, about.
    #[arg(long, default_value_t = 2_500)]
    pub tets: usize,
    /// Scenes (sag, drag, shake, tube, fall); all by default.
    #[arg(long = "scene")]
    pub scenes: Vec<String>,
    /// Young's moduli [kPa].
    #[arg(long, value_delimiter = ',', default_values_t = [3.0, 12.0, 48.0])]
    pub young: Vec<f64>,
    /// Poisson's ratios.
    #[arg(long, value_delimiter = ',', default_values_t = [0.3, 0.45, 0.49])]
    pub poisson: Vec<f64>,
    /// Most iterations; they double from 1.
    #[arg(long, default_value_t = 512)]
    pub iterations: usize,
}
