//! The figures of the element-quality study.

use crate::experiment::appendix::Condition;
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_task::Warnings;

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementQualityRow {
    /// The surroundings of the appendix.
    pub condition: Condition,
    /// Whether the jaw force is proportional to the modulus.
    pub scaled: bool,
    /// Name of the grasp design.
    pub design: String,
    /// Jaw lift (mm).
    pub lift_mm: f64,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// The pin rule.
    pub pins: String,
    /// Closing force of the jaws (N).
    pub jaw_force_n: f64,
    /// Whether the jaws attached the appendix.
    pub attached: bool,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// Whether it diverged.
    pub diverged: bool,
    /// Why it diverged.
    pub divergence: Option<String>,
    /// Why it did not pass.
    pub why: Option<String>,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Smallest volume of an element over its volume at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Whether it held: follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Tissue lift over jaw lift. None without a grasp, like the next three.
    pub follow_ratio: Option<f64>,
    /// Slip (mm).
    pub slip_mm: Option<f64>,
    /// Largest motion of a node in the first frame of the grasp (mm).
    pub activation_step_mm: Option<f64>,
    /// Largest force of held nodes on the gripper (N).
    pub peak_constraint_n: Option<f64>,
    /// How often held tissue slipped.
    pub slipped: usize,
    /// Whether the tissue tore out.
    pub torn: bool,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ElementQualityResult {
    /// All cases.
    pub rows: Vec<ElementQualityRow>,
    /// Closing force of the jaws (N); for scaled cases at 12 kPa.
    pub jaw_force_n: f64,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Elements of the appendix.
    pub tets: usize,
    /// Cases of an earlier run.
    pub resumed: Resumed,
}
