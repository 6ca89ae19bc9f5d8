//! Everything around organs and arms that does not move: field, table, ports, endoscopes.

use crate::Result;
use crate::camera::is_endoscope;
use crate::field::{Field, Recorded};
use crate::furniture::{Prop, room, scope, table};
use crate::looks::wet;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_scene::Scene;
use trocar_specimen::Specimen;

/// The field under the organs of `placed` (up along z), and the surroundings of `scene`.
/// `recording` is the pose of the recording camera.
pub(crate) fn surroundings(placed: &Specimen, recording: Pose, scene: Option<&Scene>) -> Result<Vec<Prop>> {
    let surfaces: Vec<&TriMesh> = placed.organs.iter().map(|o| &o.surface).collect();
    let recorded = match (&placed.background, &placed.camera) {
        (Some(picture), Some(camera)) => Some(Recorded { picture, camera, pose: recording }),
        _ => None,
    };
    let field = Field::under(&surfaces, recorded.as_ref())?;
    let ports = scene.map_or(&[][..], |s| &s.ports);
    let mut pieces = room(&field, ports);
    for (scene, camera) in scene.iter().flat_map(|s| s.cameras.iter().map(move |c| (s, c))) {
        if is_endoscope(camera) {
            pieces.extend(scope(&camera.shaft(&scene.placement), table(&field)));
        }
    }
    pieces.insert(0, Prop { name: "field", mesh: field.mesh, appearance: wet(0.36) });
    Ok(pieces)
}
