//! Whether the instruments of a scene reach the organ of its task.

use super::placed::Placed;
use super::{build, setpoint::Setpoint};
use crate::Result;
use crate::gripper::GRIP_DISTANCE;
use glam::{DMat3, DQuat, DVec3};
use serde::Serialize;
use trocar_core::Pose;
use trocar_geometry::OrganAxis;
use trocar_scene::{InstrumentKind, Scene, Side};
use trocar_specimen::Specimen;

/// Jaws that miss a place by less than this still close on it (m): on flat organs the tips of the
/// blades reach the cell's floor first.
pub const REACH_TOLERANCE: f64 = 8e-3;

/// Number of places along the organ that are tried.
const PLACES: u32 = 20;

/// How near an instrument comes to the place that the task wants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ToolReach {
    /// The arm.
    pub arm: Side,
    /// Its instrument.
    pub kind: InstrumentKind,
    /// Organ coordinate of the place that it comes nearest to.
    pub at: f64,
    /// Distance by which the jaws miss it (mm).
    pub missed_mm: f64,
}

impl ToolReach {
    /// Whether it reaches the organ.
    pub fn reaches(&self) -> bool {
        self.missed_mm <= 1e3 * REACH_TOLERANCE
    }
}

/// How near each instrument of `scene` comes to the organ of its task in `specimen`: a grasper to
/// the places of the grasp gate, a cutter to places between them and the base. Empty if the
/// specimen does not have the organ.
///
/// # Errors
/// A scene whose arms cannot be built.
pub fn tool_reach(scene: &Scene, specimen: &Specimen) -> Result<Vec<ToolReach>> {
    let placed = Placed::new(scene, specimen)?;
    let arms = build::arms(scene, placed.floor)?;
    let Some(organ) = placed.specimen.organs.iter().find(|o| o.name == scene.task.organ) else {
        return Ok(Vec::new());
    };
    let axis = OrganAxis::of(&organ.body, organ.base)?;
    let gates = &scene.task.gates;
    let mut all = Vec::new();
    for arm in &arms {
        let [from, to] = match arm.model.kind {
            InstrumentKind::Grasper => [gates.grasp_from, gates.grasp_to],
            InstrumentKind::Cutter => [0.0, gates.grasp_to],
        };
        let mut best: Option<ToolReach> = None;
        for k in 0..=PLACES {
            let at = from + (to - from) * f64::from(k) / f64::from(PLACES);
            let point = axis.point_at(at);
            let x = arm.model.workspace.direction_to(point);
            let z = x.any_orthonormal_vector();
            let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
            let tip = Pose { rotation, translation: point - GRIP_DISTANCE * x };
            let near = Setpoint::default().with_jaw(1.0);
            let missed: DVec3 = arm.model.workspace.solve(&tip, &near)?.rejected_translation;
            let missed_mm = 1e3 * missed.length();
            if best.is_none_or(|b| missed_mm < b.missed_mm) {
                best = Some(ToolReach { arm: arm.model.side, kind: arm.model.kind, at, missed_mm });
            }
        }
        all.extend(best);
    }
    Ok(all)
}
