//! What is rendered, and what comes of it.

use glam::DVec3;
use trocar_camera::{Camera, ColorImage, DepthImage, Pose};
use trocar_geometry::TriMesh;

/// How an instance is shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    /// sRGB base colour where the mesh has no vertex colours.
    pub color: [u8; 3],
    /// Strength of the specular highlight, 0 (matte) to 1.
    pub gloss: f32,
    /// Draw triangle edges as thin dark lines.
    pub wireframe: bool,
}

/// A mesh in the scene, in world coordinates.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The surface.
    pub mesh: TriMesh,
    /// Non-zero label written to the label image.
    pub label: u16,
    /// Its look.
    pub shading: Shading,
}

/// Meshes and a light, with search trees built.
pub struct Scene {}

/// One rendered picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Shaded colour.
    pub color: ColorImage,
    /// Metric z depth [m]; 0 where nothing was hit.
    pub depth: DepthImage,
    /// Label of the instance hit, 0 where nothing was.
    pub labels: Vec<u16>,
    /// Cosine between the surface normal and the ray at each hit, 0 where nothing was.
    pub facing: Vec<f32>,
}

impl Scene {
    /// Builds the scene. `light` is the direction towards the light; `None` puts it at the camera.
    pub fn new(instances: Vec<Instance>, light: Option<DVec3>, background: [u8; 3]) -> Self {
        let _ = (instances, light, background);
        todo!()
    }

    /// Renders through `camera` standing at `pose` (camera to world); `samples` x `samples` rays a pixel for the colour
    /// (depth, labels and facing come from the pixel's centre).
    pub fn render(&self, camera: &Camera, pose: &Pose, samples: usize) -> Frame {
        let _ = (camera, pose, samples);
        todo!()
    }
}
