//! Options that several studies have: choices by name, and numbers in the units that people write.

use crate::Result;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_scene::{GraspDesignName, ScheduleName};
use trocar_specimen::Specimen;
use trocar_workflow::phantoms;

/// A length written in millimetres, in metres.
///
/// # Errors
/// A text that is no number.
pub(crate) fn millimetres(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(|mm| 1e-3 * mm)
}

/// A pressure written in kilopascals, in pascals.
///
/// # Errors
/// A text that is no number.
pub(crate) fn kilopascals(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(|kpa| 1e3 * kpa)
}

/// An angle written in degrees, in radians.
///
/// # Errors
/// A text that is no number.
pub(crate) fn degrees(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(f64::to_radians)
}

/// The phantoms that were named, or all.
pub(crate) fn phantoms_or_all(named: &[String]) -> Vec<String> {
    if named.is_empty() { trocar_phantom::NAMES.iter().map(|n| (*n).to_owned()).collect() } else { named.to_vec() }
}

/// How phantoms are recorded.
#[derive(Clone, Copy, Debug, Args)]
pub struct Recorded {
    /// Frames of each recording (the composite's window holds 181; the paper recorded 1,790).
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomies and of the camera's noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Recorded {
    /// The recorder's options.
    pub fn options(&self) -> RecordOptions {
        RecordOptions { frames: self.frames, seed: self.seed, ..RecordOptions::default() }
    }
}

/// A scene, and where its phantom is kept.
#[derive(Clone, Debug, Args)]
pub struct SceneChoice {
    /// Scene file or built-in scene.
    #[arg(default_value = "cell-a")]
    pub scene: String,
    /// Folder of made phantoms, where a scene's phantom is made once and kept
    /// (default: $TROCAR_PHANTOMS, else trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
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
    pub fn schedule(self) -> ScheduleName {
        match self {
            Self::Paper => ScheduleName::Paper,
            Self::Fast => ScheduleName::Fast,
            Self::Adaptive => ScheduleName::Adaptive,
        }
    }

    /// Its name in reports and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Fast => "fast",
            Self::Adaptive => "adaptive",
        }
    }
}

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

/// The name of a design in reports and JSON.
pub(crate) fn design_name(design: GraspDesignName) -> &'static str {
    match design {
        GraspDesignName::Friction => "friction",
        GraspDesignName::RestPose => "rest-pose",
        GraspDesignName::LivePose => "live-pose",
        GraspDesignName::Compliant => "compliant",
    }
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

/// Kinds of depth noise by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SensorName {
    /// Independent from pixel to pixel and frame to frame.
    Plain,
    /// Like stereo matching's too: smooth over several pixels, slow to change, silhouettes
    /// fattened.
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

/// Which appendix.
#[derive(Clone, Debug, Args)]
pub struct AppendixChoice {
    /// A specimen folder with an organ named appendix; phantom A, recorded and reconstructed, by
    /// default.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// How phantom A is recorded.
    #[command(flatten)]
    pub recorded: Recorded,
}

impl AppendixChoice {
    /// The specimen and its folder. A phantom is recorded and reconstructed in the folder `output`.
    ///
    /// # Errors
    /// A specimen that cannot be read, or a phantom that cannot be made.
    pub(crate) fn read(&self, output: &Path, progress: &dyn Progress) -> Result<(Specimen, PathBuf)> {
        if let Some(folder) = &self.specimen {
            return Ok((Specimen::read(folder)?, folder.clone()));
        }
        let folder = output.join("phantom-a");
        let specimen = phantoms::specimen("phantom-a", &self.recorded.options(), &folder, progress)?;
        Ok((specimen, folder.join("specimen")))
    }
}
