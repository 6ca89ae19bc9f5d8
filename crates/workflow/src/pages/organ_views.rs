//! The contents of views of a specimen (organs, elements, cut-aways), and their directions.

use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_render::phong::{Instance, PhongScene, Shading};
use trocar_report::colors::{self, VIEW_GROUND};
use trocar_report::views::shell;
use trocar_specimen::Specimen;

/// Rays of ambient occlusion at a vertex, and how far they look (m).
const OCCLUSION_RAYS: usize = 24;
const OCCLUSION_REACH: f64 = 0.012;

/// Directions for views of a specimen.
#[derive(Clone, Copy, Debug)]
pub struct Directions {
    /// Against gravity.
    pub up: DVec3,
    /// Horizontal, towards a person at the lower edge of the recorded image.
    pub front: DVec3,
    /// Horizontal, to that person's right.
    pub right: DVec3,
}

impl Directions {
    /// The directions of `specimen`.
    pub fn of(specimen: &Specimen) -> Self {
        let up = specimen.up.normalize_or(DVec3::Z);
        // The recording frame is the camera's: y runs down the image. A ready surface has z up and
        // is looked at from -y.
        let towards = if specimen.camera.is_some() { DVec3::Y } else { DVec3::NEG_Y };
        let flat = |d: DVec3| (d - up * d.dot(up)).try_normalize();
        let front = flat(towards).or_else(|| flat(DVec3::Z)).unwrap_or_else(|| up.any_orthonormal_vector());
        Self { up, front, right: front.cross(-up) }
    }

    /// Towards an eye that looks down on the organs from the front and a little from the right.
    pub fn oblique(&self) -> DVec3 {
        0.72 * self.up + 0.75 * self.front + 0.35 * self.right
    }

    /// Towards an eye lower and from the other side.
    pub fn low(&self) -> DVec3 {
        0.38 * self.up + 0.75 * self.front - 0.65 * self.right
    }
}

/// The organs' coloured surfaces, lit from the camera.
pub fn surfaces(specimen: &Specimen) -> PhongScene {
    let instance = |(i, organ): (usize, &trocar_specimen::Organ)| {
        let shading = Shading { color: colors::organ(i), gloss: 0.35, wireframe: false };
        Instance { mesh: organ.surface.clone(), label: label(i), shading }
    };
    let instances = specimen.organs.iter().enumerate().map(instance).collect();
    PhongScene::new(instances, None, VIEW_GROUND).with_ambient_occlusion(OCCLUSION_RAYS, OCCLUSION_REACH)
}

/// Label of organ `index` in a scene.
pub fn label(index: usize) -> u16 {
    u16::try_from(index + 1).unwrap_or(u16::MAX)
}

/// The tetrahedra of every organ as wires in its colour. `cut` is a direction: the half of each
/// organ on that side of the middle of its nodes is removed. Cut faces are lighter.
pub fn wires(specimen: &Specimen, nodes: &[Vec<DVec3>], cut: Option<DVec3>) -> PhongScene {
    let instance = |(i, (organ, nodes)): (usize, (&trocar_specimen::Organ, &Vec<DVec3>))| {
        let color = colors::organ(i);
        let body = TetMesh { vertices: nodes.clone(), tets: organ.body.tets.clone() };
        let mesh = shell(&body, cut, color, colors::mix(color, [255; 3], 0.62));
        Instance { mesh, label: label(i), shading: Shading { color, gloss: 0.0, wireframe: true } }
    };
    PhongScene::new(specimen.organs.iter().zip(nodes).enumerate().map(instance).collect(), None, VIEW_GROUND)
}

/// Rest positions of every organ's nodes.
pub fn rest(specimen: &Specimen) -> Vec<Vec<DVec3>> {
    specimen.organs.iter().map(|o| o.body.vertices.clone()).collect()
}
