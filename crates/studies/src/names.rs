//! Options shared by several studies: named choices, and numbers in common units.

use crate::Result;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_scene::{GraspDesignName, ScheduleName};
use trocar_specimen::Specimen;
use trocar_workflow::paper::TABLE_I;
use trocar_workflow::phantoms;

/// Parses a length in millimetres; returns metres.
pub(crate) fn millimetres(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(|mm| 1e-3 * mm)
}

/// Parses a pressure in kilopascals; returns pascals.
pub(crate) fn kilopascals(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(|kpa| 1e3 * kpa)
}

/// Parses an angle in degrees; returns radians.
pub(crate) fn degrees(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.parse::<f64>().map(f64::to_radians)
}

/// The named phantoms; those that stand for the paper's specimens if none is named.
pub(crate) fn phantoms_or_papers(named: &[String]) -> Vec<String> {
    if !named.is_empty() {
        return named.to_vec();
    }
    let in_table = |name: &&str| TABLE_I.iter().any(|row| row.phantom == *name);
    trocar_phantom::NAMES.into_iter().filter(in_table).map(str::to_owned).collect()
}

/// How phantoms are recorded.
#[derive(Clone, Copy, Debug, Args)]
pub struct Recorded {
    /// Frames per recording. The window of the composite has 181; the paper recorded 1,790.
    #[arg(long, default_value_t = 181)]
    pub frames: usize,
    /// Seed of the anatomies and of the camera noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Recorded {
    /// The options of the recorder.
    pub fn options(&self) -> RecordOptions {
        RecordOptions { frames: self.frames, seed: self.seed, ..RecordOptions::default() }
    }
}

/// A scene, and the folder of its phantom.
#[derive(Clone, Debug, Args)]
pub struct SceneChoice {
    /// Scene file or built-in scene.
    #[arg(default_value = "cell-a")]
    pub scene: String,
    /// Folder of phantoms. A phantom is made once and used again (default: $TROCAR_PHANTOMS, else
    /// trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}

/// Values of an option, each for a variant of a type of another crate.
macro_rules! choice {
    ($(#[$about:meta])* $name:ident: $target:ty { $($(#[$help:meta])* $value:ident => $variant:ident,)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub enum $name {
            $($(#[$help])* $value,)*
        }

        impl From<$name> for $target {
            fn from(name: $name) -> Self {
                match name {
                    $($name::$value => Self::$variant,)*
                }
            }
        }
    };
}

choice! {
    /// A solver.
    SolverName: ScheduleName {
        /// Vertex Block Descent as in the paper: 8 substeps of 10 sweeps, from the inertial
        /// predictor.
        Paper => Paper,
        /// The warped, prefactored quasi-Newton method.
        Fast => Fast,
        /// Vertex Block Descent from the adaptive start.
        Adaptive => Adaptive,
    }
}

impl SolverName {
    /// The name in reports and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Fast => "fast",
            Self::Adaptive => "adaptive",
        }
    }
}

choice! {
    /// A grasp design.
    DesignName: GraspDesignName {
        /// Friction of two closing blades.
        Friction => Friction,
        /// Nodes tied to the jaws at their places in the undeformed organ, as in the paper: the
        /// tissue snaps.
        RestPose => RestPose,
        /// Nodes tied to the jaws where they are when the jaws close, as in the paper.
        LivePose => LivePose,
        /// Like live-pose, through springs that slip and tear.
        Compliant => Compliant,
    }
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

choice! {
    /// A model of the unseen back.
    BackName: trocar_reconstruct::BackRule {
        /// As thick as the silhouette is wide, as in the paper. Flat organs become too thick.
        Rounded => Rounded,
        /// As thick behind the rim as the front is above it.
        Fitted => Fitted,
    }
}

choice! {
    /// A mesher.
    MesherName: trocar_reconstruct::MesherRule {
        /// Isosurface stuffing: no slivers, fine at the surface, coarse inside.
        Lattice => Lattice,
        /// The program TetGen with the settings of the paper (Debian: apt install tetgen).
        Tetgen => Tetgen,
    }
}

choice! {
    /// Unit of length of a surface file.
    Units: trocar_geometry::io::Unit {
        /// Millimetres.
        Mm => Millimetre,
        /// Centimetres.
        Cm => Centimetre,
        /// Metres.
        M => Metre,
    }
}

choice! {
    /// A kind of depth noise.
    SensorName: trocar_phantom::Sensor {
        /// Independent between pixels and frames.
        Plain => Plain,
        /// Like stereo matching: smooth over several pixels, slow in time, with widened
        /// silhouettes.
        Stereo => Stereo,
    }
}

choice! {
    /// What holds the lifted organ besides its bed.
    SupportName: trocar_phantom::HiddenSupport {
        /// Its base alone.
        Base => Base,
        /// Its base, and a slack sheet along the half beyond the middle.
        Mesentery => Mesentery,
        /// Its base, and a short adhesion at the tip.
        Adhesion => Adhesion,
    }
}

/// The source of the appendix.
#[derive(Clone, Debug, Args)]
pub struct AppendixChoice {
    /// Specimen folder with an organ named appendix; by default phantom A, recorded and
    /// reconstructed.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// How phantom A is recorded.
    #[command(flatten)]
    pub recorded: Recorded,
}

impl AppendixChoice {
    /// The specimen and its folder. A phantom is recorded and reconstructed in the folder `output`.
    pub(crate) fn read(&self, output: &Path, progress: &dyn Progress) -> Result<(Specimen, PathBuf)> {
        if let Some(folder) = &self.specimen {
            return Ok((Specimen::read(folder)?, folder.clone()));
        }
        let folder = output.join("phantom-a");
        let specimen = phantoms::specimen(
            "phantom-a",
            &self.recorded.options(),
            None,
            &folder,
            phantoms::AfterUse::Keep,
            progress,
        )?;
        Ok((specimen, folder.join("specimen")))
    }
}
