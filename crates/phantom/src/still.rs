//! The anatomy without instruments, rendered once: the truth every frame starts from.

use crate::anatomy::Anatomy;
use crate::plan::Plan;
use crate::{paint, sensor};
use trocar_camera::{Camera, Mask};
use trocar_core::Pose;
use trocar_geometry::{TriMesh, isosurface, sample_distance};
use trocar_render::{Frame, Instance, Scene, Shading, label_mask};

/// Resolution of the organs' surfaces and of the bed [m].
#[derive(Clone, Copy)]
pub(crate) struct Fineness {
    pub surface: f64,
    pub bed: f64,
}

/// The scene's surfaces, coloured, and its noise-free picture.
pub(crate) struct Still {
    /// One surface an organ, in their order.
    pub surfaces: Vec<TriMesh>,
    /// Labels are 1 + the organ's index; the bed's is one more than the last.
    pub frame: Frame,
    /// Depth at which the lamp is as bright as the colours mean [m].
    pub lit_at: f32,
}

impl Still {
    pub fn new(plan: &Plan, anatomy: &Anatomy, camera: &Camera, fineness: Fineness) -> Self {
        let mut surfaces = Vec::new();
        let mut instances = Vec::new();
        for organ in &anatomy.organs {
            let mut mesh = isosurface(&sample_distance(&organ.body, organ.body.bounds(), fineness.surface), 0.0);
            paint::organ(organ, &mut mesh);
            let shading = Shading { color: [200, 120, 110], gloss: paint::gloss(organ.look), wireframe: false };
            instances.push(Instance { mesh: mesh.clone(), label: instances.len() as u16 + 1, shading });
            surfaces.push(mesh);
        }
        let mut bed = anatomy.bed.mesh(fineness.bed);
        paint::bed(&anatomy.bed, &mut bed);
        let shading = Shading { color: [180, 90, 80], gloss: 0.12, wireframe: false };
        instances.push(Instance { mesh: bed, label: instances.len() as u16 + 1, shading });

        let scene = Scene::new(instances, None, [0; 3]).with_ambient_occlusion(20, plan.crease);
        let mut frame = scene.render(camera, &Pose::IDENTITY, 2);
        for (i, color) in frame.color.pixels.iter_mut().enumerate() {
            let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
            *color = sensor::lit(*color, sensor::lamp(camera, u, v, frame.depth.depth[i], plan.lit_at));
        }
        Self { surfaces, frame, lit_at: plan.lit_at }
    }

    /// Pixels that show organ `index`.
    pub fn organ_mask(&self, index: usize) -> Mask {
        label_mask(&self.frame, index as u16 + 1)
    }
}
