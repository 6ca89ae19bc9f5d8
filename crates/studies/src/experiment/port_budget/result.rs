//! The figures of the port budget.

use serde::Serialize;

/// Sheets beside the one that was asked for (mm).
pub(super) const SHEETS: [f64; 2] = [1.0, 2.0];

/// One tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetRow {
    /// Angle between the shaft and the port's normal (degrees).
    pub tilt_deg: f64,
    /// Lateral clearance by the formula (mm); negative where the shaft does not fit.
    pub clearance_mm: f64,
    /// Farthest that a shaft is pushed in the direction of its tilt before the contact model
    /// touches (mm); none where it does not fit.
    pub measured_mm: Option<f64>,
    /// The same against the direction of the tilt (mm).
    pub measured_against_mm: Option<f64>,
    /// The same across it (mm).
    pub measured_across_mm: Option<f64>,
    /// The least to any side (mm).
    pub measured_least_mm: Option<f64>,
    /// How far the push takes it in the direction of its tilt, the rim yielding (mm).
    pub pushed_mm: f64,
    /// Clearance by the formula in thicker sheets, 1 and 2 mm (mm).
    pub thicker_mm: [f64; 2],
}

/// A start pose of the paper.
#[derive(Clone, Debug, Serialize)]
pub struct PortStart {
    /// The arm.
    pub arm: &'static str,
    /// Its tilt (degrees).
    pub tilt_deg: f64,
    /// The paper's clearance (mm).
    pub paper_mm: f64,
    /// The formula's (mm).
    pub clearance_mm: f64,
    /// That of the contact model (mm).
    pub measured_mm: Option<f64>,
}

/// The room to all sides at one tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortRoom {
    /// The tilt (degrees).
    pub tilt_deg: f64,
    /// Direction of the push from that of the tilt (degrees), and the farthest before something
    /// touches (mm).
    pub room: Vec<(f64, f64)>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetResult {
    /// Diameter of the hole (mm).
    pub hole_mm: f64,
    /// Diameter of the shaft (mm).
    pub shaft_mm: f64,
    /// Thickness of the sheet (mm).
    pub thickness_mm: f64,
    /// Stiffness of the rim (N/mm).
    pub stiffness_n_mm: f64,
    /// The push (N).
    pub push_n: f64,
    /// Every tilt.
    pub rows: Vec<PortBudgetRow>,
    /// The paper's start poses.
    pub starts: Vec<PortStart>,
    /// The room to all sides.
    pub rooms: Vec<PortRoom>,
    /// Tilt without clearance by the formula (degrees); none where even an upright shaft has none.
    pub limit_deg: Option<f64>,
    /// The tilt at which a centred shaft touches in the contact model (degrees).
    pub measured_limit_deg: Option<f64>,
    /// The paper's (degrees).
    pub paper_limit_deg: f64,
    /// Largest difference between formula and contact model in the direction of the tilt (mm).
    pub largest_difference_mm: f64,
    /// Wall time (s).
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}
