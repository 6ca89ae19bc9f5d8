//! Arguments of the commands that measure grasps.

use clap::{Args, ValueEnum};
use std::path::PathBuf;
use trocar_phantom::RecordOptions;
use trocar_scene::GraspDesignName;
use trocar_studies::{AppendixSource, Condition};

/// Grasp designs by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum DesignName {
    /// Nothing but the friction of two blades that press.
    Friction,
    /// Tied to the jaws where the undeformed organ was: the paper's, which jumps.
    RestPose,
    /// Tied to the jaws where it is when they close: the paper's, which does not.
    LivePose,
    /// As live-pose on springs that slide and tear.
    Compliant,
}

impl From<DesignName> for GraspDesignName {
    fn from(name: DesignName) -> Self {
        match name {
            DesignName::Friction => Self::Friction,
            DesignName::RestPose => Self::RestPose,
            DesignName::LivePose => Self::LivePose,
            DesignName::Compliant => Self::Compliant,
        }
    }
}

/// In what the appendix is lifted.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ConditionName {
    /// In the whole cell: organs touch each other, and a dynamic arm works through its port.
    Cell,
    /// The appendix alone, lifted by an ideal arm without a port.
    Appendix,
    /// Both, one after the other.
    Both,
}

impl ConditionName {
    /// The conditions of this name.
    pub fn conditions(self) -> Vec<Condition> {
        match self {
            Self::Cell => vec![Condition::Cell],
            Self::Appendix => vec![Condition::Appendix],
            Self::Both => vec![Condition::Cell, Condition::Appendix],
        }
    }
}

/// Which appendix.
#[derive(Debug, Args)]
pub struct AppendixChoice {
    /// A specimen folder with an organ named appendix; phantom A, recorded and reconstructed, by default.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Frames of phantom A's recording.
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomy and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl AppendixChoice {
    /// How phantom A is filmed.
    pub fn record(&self) -> RecordOptions {
        RecordOptions { frames: self.frames, seed: self.seed, ..RecordOptions::default() }
    }
}

impl From<&AppendixChoice> for AppendixSource {
    fn from(choice: &AppendixChoice) -> Self {
        Self { specimen: choice.specimen.clone(), record: choice.record() }
    }
}

/// Arguments of `experiment grasp-designs`.
#[derive(Debug, Args)]
pub struct GraspDesignsExperiment {
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// In what the appendix is lifted: the whole cell, alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Lift of the jaws (mm).
    #[arg(long, default_value_t = 15.0)]
    pub lift: f64,
    /// Force with which the jaws close [N].
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Trials at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder for recording, specimen, trials and report. A finished recording in it is used again, and so are finished trials of the same settings: a run that was interrupted
    /// goes on where it stopped.
    #[arg(short, long, default_value = "trocar-experiment/grasp-designs")]
    pub output: PathBuf,
}

/// Arguments of `experiment element-quality`.
#[derive(Debug, Args)]
pub struct ElementQualityExperiment {
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// In what the appendix is lifted: the whole cell, alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Force with which the jaws close (N), the same for all moduli.
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Run all cases a second time with a jaw force in proportion to the modulus (--jaw-force at 12 kPa), so that
    /// tissue of every modulus is squeezed alike: a second table.
    #[arg(long)]
    pub scaled_force: bool,
    /// Cases at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder for recording, specimen, trials and report. A finished recording in it is used again, and so are finished trials of the same settings: a run that was interrupted
    /// goes on where it stopped.
    #[arg(short, long, default_value = "trocar-experiment/element-quality")]
    pub output: PathBuf,
}

/// Arguments of `bench grasp`.
#[derive(Debug, Args)]
pub struct GraspBench {
    #[command(flatten)]
    pub specimen: AppendixChoice,
    /// How the jaws hold.
    #[arg(long, value_enum, default_value_t = DesignName::LivePose)]
    pub design: DesignName,
    /// Force with which the jaws close [N].
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Times that the pair of runs, with contact and without, is repeated.
    #[arg(long, default_value_t = 3)]
    pub repeats: usize,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Folder for the phantom's recording and specimen; a finished recording in it is used again.
    #[arg(short, long, default_value = "trocar-bench/grasp")]
    pub output: PathBuf,
}
