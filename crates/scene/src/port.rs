//! Ports: the holes through which instruments work.

use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// A hole in the wall, through which an instrument works.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Name.
    pub name: String,
    /// Centre in the cell frame (m).
    pub centre_m: [f64; 3],
    /// Unit vector out of the body, towards the arm.
    #[serde(default = "upwards")]
    pub normal: [f64; 3],
    /// Diameter of the hole (mm).
    #[serde(default = "hole")]
    pub hole_diameter_mm: f64,
    /// Thickness of the wall (mm); of a wall of 0 the hole is one edge, as in the paper's formula
    /// of the clearance. One of 2 mm leaves a shaft of 5 mm in 6 mm 19 degrees of tilt.
    #[serde(default = "sheet")]
    pub sheet_thickness_mm: f64,
    /// Diameter of the piece of abdominal wall that pictures show round the hole (mm); of 0 they
    /// show a ring on a holder alone. Nothing but pictures knows of it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub sheet_diameter_mm: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn upwards() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn hole() -> f64 {
    6.0
}

fn sheet() -> f64 {
    0.0
}

impl Port {
    /// A port of the paper's size at `centre_m`.
    pub(crate) fn paper(name: &str, centre_m: [f64; 3]) -> Self {
        Self {
            name: name.to_owned(),
            centre_m,
            normal: upwards(),
            hole_diameter_mm: hole(),
            sheet_thickness_mm: sheet(),
            sheet_diameter_mm: 0.0,
        }
    }

    /// Its frame in the cell: origin at the centre, z along the normal, x the cell's x as far as it
    /// lies in the wall (the cell's y where it does not).
    pub fn frame(&self) -> Pose {
        let z = DVec3::from(self.normal).normalize_or(DVec3::Z);
        let in_wall = |v: DVec3| v - v.dot(z) * z;
        let along = if z.x.abs() < 0.99 { in_wall(DVec3::X) } else { in_wall(DVec3::Y) };
        let x = along.normalize_or(DVec3::X);
        let rotation = DQuat::from_mat3(&glam::DMat3::from_cols(x, z.cross(x), z));
        Pose { rotation, translation: self.centre_m.into() }
    }

    /// Largest tilt of a shaft of `diameter_mm` (rad): acos(d/D), where it fills the hole; `None`
    /// for a shaft that does not fit.
    pub fn tilt_limit(&self, diameter_mm: f64) -> Option<f64> {
        let share = diameter_mm / self.hole_diameter_mm;
        (share > 0.0 && share < 1.0).then(|| libm::acos(share))
    }
}
