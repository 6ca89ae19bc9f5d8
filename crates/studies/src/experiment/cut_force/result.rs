//! The figures of the force of scissors.

use serde::Serialize;

/// A frame in which the blades moved.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CutSample {
    /// Angle of the blades in the middle of it (rad).
    pub angle_rad: f64,
    /// By how much they closed (rad).
    pub turned_rad: f64,
    /// Force that the jaws felt, at the middle of the blades (N).
    pub force_n: f64,
    /// The torque of that force (N m).
    pub torque_nm: f64,
    /// The closed form at that angle (N m); none for the tube, and none before the blades meet the
    /// slab.
    pub closed_form_nm: Option<f64>,
}

/// One cut.
#[derive(Clone, Debug, Serialize)]
pub struct CutRow {
    /// slab or tube.
    pub shape: &'static str,
    /// Toughness (J/m2).
    pub toughness_j_m2: f64,
    /// Largest force that the jaws felt, at the middle of the blades (N).
    pub force_peak_n: f64,
    /// Largest difference of the torque from the closed form within the compared angles, over the
    /// closed form; none for the tube.
    pub force_error: Option<f64>,
    /// Work of the jaws: torque integrated over angle (mJ).
    pub work_mj: f64,
    /// Area that opened, projected on the plane of the cut (mm2).
    pub section_mm2: f64,
    /// Area of the faces that opened (mm2).
    pub area_mm2: f64,
    /// Difference of toughness times the projected area from the work, over the work.
    pub work_error: f64,
    /// Pieces after the cut.
    pub pieces: usize,
    /// Inverted elements after the cut.
    pub inverted: usize,
    /// Frames in which the blades moved.
    pub samples: Vec<CutSample>,
}

/// Jaws that are too weak for a slab.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WeakScissors {
    /// Force of the jaws (N).
    pub force_n: f64,
    /// Toughness of the slab (J/m2).
    pub toughness_j_m2: f64,
    /// Angle at which the blades stand (rad).
    pub stands_rad: f64,
    /// Angle at which the closed form takes the torque that the jaws have (rad).
    pub closed_form_rad: f64,
    /// Whether an event told of a cut.
    pub cut: bool,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct CutForceResult {
    /// Largest difference of the torque on slabs from the closed form.
    pub cut_force_error: f64,
    /// Largest difference of toughness times area from the work.
    pub work_error: f64,
    /// Thickness of the slab (mm).
    pub thickness_mm: f64,
    /// Distance from the pivot at which forces of the jaws act (mm).
    pub lever_mm: f64,
    /// Angles between which the torque on slabs is compared with the closed form (rad).
    pub compared_rad: [f64; 2],
    /// All cuts.
    pub rows: Vec<CutRow>,
    /// Jaws that are too weak.
    pub weak: WeakScissors,
}
