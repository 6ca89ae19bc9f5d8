//! The figures of the element-quality study.

use crate::experiment::appendix::Condition;
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementQualityRow {
    /// In what the appendix was lifted.
    pub condition: Condition,
    /// The jaw force is in proportion to the modulus.
    pub scaled: bool,
    /// The grasp design's name.
    pub design: String,
    /// Jaw lift (mm).
    pub lift_mm: f64,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// The pin rule.
    pub pins: String,
    /// Force of the jaws (N).
    pub jaw_force_n: f64,
    /// The jaws took hold of the appendix.
    pub attached: bool,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// It diverged.
    pub diverged: bool,
    /// Why.
    pub divergence: Option<String>,
    /// Why it did not pass, in one line.
    pub why: Option<String>,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Smallest volume of an element over its volume at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip (mm).
    pub slip_mm: f64,
    /// Largest motion of any node in the first frame of the grasp (mm): what moved.
    pub activation_step_mm: f64,
    /// Largest pull of held nodes at the gripper (N).
    pub peak_constraint_n: f64,
    /// Times that held tissue began to slide.
    pub slipped: usize,
    /// The tissue tore out.
    pub torn: bool,
    /// Suspensions of physics: contacts disabled, contacts of blades disabled, organs relaxed.
    pub suspensions: [usize; 3],
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ElementQualityResult {
    /// Every case.
    pub rows: Vec<ElementQualityRow>,
    /// Force of the jaws (N); of scaled cases at 12 kPa.
    pub jaw_force_n: f64,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Its elements.
    pub tets: usize,
    /// What an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time of everything (s).
    pub seconds: f64,
    /// The page's path.
    pub report: String,
}
