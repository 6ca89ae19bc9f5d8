//! The anatomy without instruments, rendered once: ground truth and background of every frame.

use crate::anatomy::Anatomy;
use crate::spec::{PhantomSpec, Resolution};
use crate::{paint, sensor};
use trocar_camera::{Camera, Mask};
use trocar_core::Pose;
use trocar_geometry::{TriMesh, isosurface, sample_distance};
use trocar_render::phong::{Instance, PhongImage, PhongScene, Shading, label_mask};

/// Coloured surfaces of the anatomy and its noise-free picture.
pub(crate) struct StaticView {
    /// One surface per organ.
    pub surfaces: Vec<TriMesh>,
    /// Label `i + 1` is organ `i`; the bed has the label after the last organ.
    pub frame: PhongImage,
    /// Distance at which the lamp has brightness 1 (m).
    pub lamp_distance: f32,
}

impl StaticView {
    pub fn new(spec: &PhantomSpec, anatomy: &Anatomy, camera: &Camera, resolution: Resolution) -> Self {
        Self::without(None, spec, anatomy, camera, resolution)
    }

    /// The view without the organ of this index, which moves in front of it.
    pub fn without(
        hidden: Option<usize>,
        spec: &PhantomSpec,
        anatomy: &Anatomy,
        camera: &Camera,
        resolution: Resolution,
    ) -> Self {
        let mut surfaces = Vec::new();
        let mut instances = Vec::new();
        for (index, organ) in anatomy.organs.iter().enumerate() {
            let mut mesh = isosurface(&sample_distance(&organ.body, organ.body.bounds(), resolution.surface), 0.0);
            paint::organ(organ, &mut mesh);
            if hidden != Some(index) {
                instances.push(Instance {
                    mesh: mesh.clone(),
                    label: index as u16 + 1,
                    shading: paint::shading(organ.look),
                });
            }
            surfaces.push(mesh);
        }
        let mut bed = anatomy.bed.mesh(resolution.bed);
        paint::bed(&anatomy.bed, &mut bed);
        let shading = Shading { color: [180, 90, 80], gloss: 0.12, wireframe: false };
        instances.push(Instance { mesh: bed, label: anatomy.organs.len() as u16 + 1, shading });

        let scene = PhongScene::new(instances, None, [0; 3]).with_ambient_occlusion(20, spec.occlusion_reach);
        let mut frame = scene.render(camera, &Pose::IDENTITY, 2);
        for (i, color) in frame.color.pixels.iter_mut().enumerate() {
            let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
            *color = sensor::with_brightness(
                *color,
                sensor::lamp_brightness(camera, u, v, frame.depth.depth[i], spec.lamp_distance),
            );
        }
        Self { surfaces, frame, lamp_distance: spec.lamp_distance }
    }

    /// Pixels that show organ `index`.
    pub fn organ_mask(&self, index: usize) -> Mask {
        label_mask(&self.frame, index as u16 + 1)
    }
}
