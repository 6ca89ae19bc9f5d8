//! The surfaces of organs that touch and that are drawn, as the scene chooses them.

use crate::{Error, Result};
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{MeshDistance, SignedDistance, TriMesh, remeshed};
use trocar_scene::{CollisionMesh, RenderMesh, Scene, Surfaces};
use trocar_specimen::Organ;

/// Farthest that a drawn surface may be from the elements (m).
const MAX_AWAY: f64 = 10e-3;

/// The collision surface of `organ`, in the specimen's frame; None for the boundary of its
/// elements. Gives the organ the skin that pictures show.
///
/// # Errors
/// Names the field with a mesh that cannot be read, made or bound to the organ.
pub(super) fn choose(scene: &Scene, organ: &mut Organ, said: &Surfaces) -> Result<Option<TriMesh>> {
    let wrong = |key: &str, reason: String| Error::Scene {
        scene: scene.label(),
        field: format!("organ.{}.surfaces.{key}", organ.name),
        reason,
    };
    let read = |key: &str, file: &str| {
        read_surface(&scene.resolve(file), Unit::Metre).map_err(|error| wrong(key, format!("is unusable: {error}")))
    };
    let collision = match &said.collision {
        CollisionMesh::Elements => None,
        CollisionMesh::EdgeMm(edge) => {
            let made = remeshed(&organ.surface, 1e-3 * edge);
            Some(made.map_err(|error| wrong("collision.edge_mm", format!("is {edge}: {error}")))?)
        }
        CollisionMesh::File(file) => Some(read("collision.file", file)?),
    };
    let drawn = match &said.render {
        RenderMesh::Skin => None,
        RenderMesh::Elements => Some(organ.body.boundary().0),
        RenderMesh::Collision => Some(collision.clone().unwrap_or_else(|| organ.body.boundary().0)),
        RenderMesh::File(file) => Some(read("render.file", file)?),
    };
    if let Some(mut drawn) = drawn {
        let elements = MeshDistance::new(&organ.body.boundary().0)?;
        let away = |p: &glam::DVec3| elements.distance(*p);
        if let Some(i) = drawn.vertices.iter().position(|p| away(p) > MAX_AWAY) {
            let reason = format!(
                "has vertex {i} {:.0} mm away from the elements; at most {:.0} mm (is it in metres, and of this organ?)",
                1e3 * away(&drawn.vertices[i]),
                1e3 * MAX_AWAY
            );
            return Err(wrong("render", reason));
        }
        if drawn.colors.len() != drawn.vertices.len() || said.render == RenderMesh::Collision {
            drawn.color_like(&organ.surface);
        }
        organ.surface = drawn;
    }
    Ok(collision)
}
