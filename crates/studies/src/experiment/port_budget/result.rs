//! The figures of the port budget.

use serde::Serialize;

/// Thicknesses of further sheets (mm).
pub(super) const SHEETS: [f64; 2] = [1.0, 2.0];

/// Figures at one tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetRow {
    /// Angle between the shaft and the normal of the port (degrees).
    pub tilt_deg: f64,
    /// Lateral clearance by the formula (mm); negative if the shaft does not fit.
    pub clearance_mm: f64,
    /// Measured clearance in the direction of the tilt (mm); none if the shaft does not fit.
    pub measured_mm: Option<f64>,
    /// The same in the opposite direction (mm).
    pub measured_against_mm: Option<f64>,
    /// The same across the tilt (mm).
    pub measured_across_mm: Option<f64>,
    /// The smallest in any direction (mm).
    pub measured_least_mm: Option<f64>,
    /// Deviation under the lateral force in the direction of the tilt, with the rim deformed (mm).
    pub pushed_mm: f64,
    /// Clearance by the formula in sheets of 1 and 2 mm (mm).
    pub thicker_mm: [f64; 2],
}

/// A start pose of the paper.
#[derive(Clone, Debug, Serialize)]
pub struct PortStart {
    /// The arm.
    pub arm: &'static str,
    /// Tilt (degrees).
    pub tilt_deg: f64,
    /// Clearance in the paper (mm).
    pub paper_mm: f64,
    /// Clearance by the formula (mm).
    pub clearance_mm: f64,
    /// Clearance in the contact model (mm).
    pub measured_mm: Option<f64>,
}

/// Clearance in all directions at one tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortRoom {
    /// Tilt (degrees).
    pub tilt_deg: f64,
    /// Angle of the push from the direction of the tilt (degrees), and measured clearance (mm).
    pub room: Vec<(f64, f64)>,
}

/// Figures of the study.
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
    /// Lateral force (N).
    pub push_n: f64,
    /// All tilts.
    pub rows: Vec<PortBudgetRow>,
    /// Start poses of the paper.
    pub starts: Vec<PortStart>,
    /// Clearance in all directions.
    pub rooms: Vec<PortRoom>,
    /// Tilt without clearance by the formula (degrees); none if even an upright shaft has no
    /// clearance.
    pub limit_deg: Option<f64>,
    /// Tilt at which a centred shaft touches in the contact model (degrees).
    pub measured_limit_deg: Option<f64>,
    /// The same in the paper (degrees).
    pub paper_limit_deg: f64,
    /// Largest difference between formula and contact model in the direction of the tilt (mm).
    pub largest_difference_mm: f64,
}
