//! Arguments of the commands that measure ports, the force at the tool mount and the control of arms.

use clap::Args;
use std::path::PathBuf;

/// Arguments of `experiment port-budget`.
#[derive(Debug, Args)]
pub struct PortBudgetExperiment {
    /// Diameter of the hole [mm].
    #[arg(long, default_value_t = 6.0, allow_negative_numbers = true)]
    pub hole: f64,
    /// Diameter of the shaft [mm].
    #[arg(long, default_value_t = 5.0, allow_negative_numbers = true)]
    pub shaft: f64,
    /// Thickness of the sheet [mm]; at 0 the clearance is the paper's.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub thickness: f64,
    /// Force of the push for the deviation under load [N].
    #[arg(long, default_value_t = 5.0, allow_negative_numbers = true)]
    pub push: f64,
    /// Folder for the report.
    #[arg(short, long, default_value = "trocar-experiment/port-budget")]
    pub output: PathBuf,
}

/// Arguments of `experiment wrench`.
#[derive(Debug, Args)]
pub struct WrenchExperiment {
    /// Static poses of an identification.
    #[arg(long, default_value_t = trocar_robot::wrench::STATIC_POSES)]
    pub poses: usize,
    /// Largest tilt of the instrument in them [degrees].
    #[arg(long, default_value_t = 60.0, allow_negative_numbers = true)]
    pub tilt: f64,
    /// Identifications, each with other noise.
    #[arg(long, default_value_t = 400)]
    pub runs: usize,
    /// Noise of a force reading [N].
    #[arg(long, default_value_t = 0.02, allow_negative_numbers = true)]
    pub force_noise: f64,
    /// Noise of a torque reading [N m].
    #[arg(long, default_value_t = 0.001, allow_negative_numbers = true)]
    pub torque_noise: f64,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for the report.
    #[arg(short, long, default_value = "trocar-experiment/wrench")]
    pub output: PathBuf,
}

/// Arguments of `experiment controller-grid`.
#[derive(Debug, Args)]
pub struct ControllerGridExperiment {
    /// Configurations at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder for the report; finished configurations in it are used again.
    #[arg(short, long, default_value = "trocar-experiment/controller-grid")]
    pub output: PathBuf,
}
