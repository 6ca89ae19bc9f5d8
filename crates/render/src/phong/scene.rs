//! Scenes of the simple renderer and their images.

use super::drawn::{Hits, Row};
use super::shade::{Lit, shade};
use super::trace::{Hit, Tracer};
use crate::srgb;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::OnceLock;
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_core::Pose;
use trocar_geometry::TriMesh;

/// Shading of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    /// sRGB base colour, used if the mesh has no vertex colours.
    pub color: [u8; 3],
    /// Strength of the specular highlight, from 0 (matte) to 1.
    pub gloss: f32,
    /// Draws triangle edges as thin dark lines.
    pub wireframe: bool,
}

/// A mesh of a scene, in world coordinates.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The surface.
    pub mesh: TriMesh,
    /// Non-zero label for the label image.
    pub label: u16,
    /// Its shading.
    pub shading: Shading,
}

/// Meshes and a light with their search tree.
///
/// ```
/// use glam::DVec3;
/// use trocar_camera::Camera;
/// use trocar_core::Pose;
/// use trocar_geometry::TriMesh;
/// use trocar_render::phong::{Instance, PhongScene, Shading};
///
/// let corners = [[-0.1, -0.1, 0.2], [0.1, -0.1, 0.2], [0.0, 0.1, 0.2]];
/// let mesh = TriMesh {
///     vertices: corners.map(DVec3::from).to_vec(),
///     triangles: vec![[0, 1, 2]],
///     colors: Vec::new(),
/// };
/// let shading = Shading { color: [200, 120, 110], gloss: 0.3, wireframe: false };
/// let scene = PhongScene::new(vec![Instance { mesh, label: 1, shading }], None, [0; 3]);
/// let image = scene.render(&Camera::centred(64, 48, 0.9), &Pose::IDENTITY, 1);
/// assert_eq!(image.labels[24 * 64 + 32], 1);
/// ```
pub struct PhongScene {
    tracer: Tracer,
    /// Per triangle: the index of its instance and its vertices in the arrays below.
    triangles: Vec<(u32, [u32; 3])>,
    looks: Vec<(u16, Shading)>,
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// Linear base colour per vertex.
    albedo: Vec<[f32; 3]>,
    /// Unit normal per triangle.
    flat: Vec<DVec3>,
    occlusion: Option<Occlusion>,
    light: Option<DVec3>,
    background: [u8; 3],
}

/// Ambient occlusion: what [`PhongScene::with_ambient_occlusion`] was given, and the ambient
/// visibility of each vertex that was seen.
struct Occlusion {
    rays: usize,
    reach: f64,
    open: Vec<OnceLock<f32>>,
}

/// A rendered image with its depth and labels.
#[derive(Clone, Debug)]
pub struct PhongImage {
    /// Shaded colour.
    pub color: ColorImage,
    /// Depth along the camera's z axis (m); 0 where no surface is.
    pub depth: DepthImage,
    /// Label of the visible instance; 0 where no surface is.
    pub labels: Vec<u16>,
    /// Cosine between the surface normal and the ray, 1 for a surface seen head-on from either
    /// side; 0 where no surface is.
    pub facing: Vec<f32>,
}

/// The pixels of `image` that show `label`.
pub fn label_mask(frame: &PhongImage, label: u16) -> Mask {
    let set = frame.labels.iter().map(|l| *l == label).collect();
    Mask { width: frame.color.width, height: frame.color.height, set }
}

/// A camera at its pose, and the light.
pub(super) struct View<'a> {
    pub camera: &'a Camera,
    pub pose: &'a Pose,
    /// Direction to the light, of unit length; `None` for a light at the camera.
    pub light: Option<DVec3>,
}

impl View<'_> {
    /// World direction through a pixel, with z = 1 in the camera frame: the ray parameter of a hit
    /// is its depth.
    pub fn direction(&self, u: f64, v: f64) -> DVec3 {
        self.pose.rotation * self.camera.ray(u, v)
    }
}

impl PhongScene {
    /// Builds the scene. `light` is the direction towards the light; `None` puts the light at the
    /// camera. Triangles with a missing or non-finite vertex are left out.
    pub fn new(instances: Vec<Instance>, light: Option<DVec3>, background: [u8; 3]) -> Self {
        let mut scene = Self {
            tracer: Tracer::new(&[]),
            triangles: Vec::new(),
            looks: Vec::new(),
            positions: Vec::new(),
            normals: Vec::new(),
            albedo: Vec::new(),
            flat: Vec::new(),
            occlusion: None,
            light,
            background,
        };
        for (index, Instance { mesh, label, shading }) in instances.into_iter().enumerate() {
            let first = scene.positions.len() as u32;
            let usable = |t: &[u32; 3]| t.iter().all(|&v| mesh.vertices.get(v as usize).is_some_and(|p| p.is_finite()));
            let mut normals = vec![DVec3::ZERO; mesh.vertices.len()];
            for triangle in mesh.triangles.iter().filter(|t| usable(t)) {
                let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
                let area_normal = (b - a).cross(c - a);
                for &v in triangle {
                    normals[v as usize] += area_normal;
                }
                scene.triangles.push((index as u32, triangle.map(|v| first + v)));
            }
            scene.normals.extend(normals.into_iter().map(DVec3::normalize_or_zero));
            if mesh.colors.len() == mesh.vertices.len() {
                scene.albedo.extend(mesh.colors.iter().map(|c| srgb::to_linear(*c)));
            } else {
                scene.albedo.resize(scene.albedo.len() + mesh.vertices.len(), srgb::to_linear(shading.color));
            }
            scene.positions.extend(mesh.vertices);
            scene.looks.push((label, shading));
        }
        let corners: Vec<_> = scene.triangles.iter().map(|(_, t)| t.map(|v| scene.positions[v as usize])).collect();
        scene.tracer = Tracer::new(&corners);
        scene.flat = corners.iter().map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero()).collect();
        scene
    }

    /// Adds ambient occlusion: `rays` rays per vertex look for surfaces closer than `reach` (m).
    /// The meshes must be fine compared with `reach`. Only vertices that a picture shows cost time.
    pub fn with_ambient_occlusion(mut self, rays: usize, reach: f64) -> Self {
        let open = self.positions.iter().map(|_| OnceLock::new()).collect();
        self.occlusion = Some(Occlusion { rays, reach, open });
        self
    }

    /// Ambient visibility of a vertex, in [0, 1].
    fn open(&self, vertex: usize) -> f32 {
        let Some(Occlusion { rays, reach, open }) = &self.occlusion else { return 1.0 };
        *open[vertex].get_or_init(|| self.unoccluded(vertex, *rays, *reach))
    }

    /// The share of a vertex's rays that meet no surface.
    fn unoccluded(&self, vertex: usize, rays: usize, reach: f64) -> f32 {
        const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
        let normal = self.normals[vertex];
        if normal == DVec3::ZERO || rays == 0 {
            return 1.0;
        }
        let (x, y) = normal.any_orthonormal_pair();
        let origin = self.positions[vertex] + normal * (0.02 * reach);
        // A spiral over the cosine-weighted hemisphere. It starts at a different angle for each
        // vertex, so no pattern shows.
        let turn = vertex as f64 * 1.324_717_957_244_746;
        let free = (0..rays).filter(|&k| {
            let r2 = (k as f64 + 0.5) / rays as f64;
            let (sin, cos) = (k as f64 * GOLDEN_ANGLE + turn).sin_cos();
            let direction = (x * cos + y * sin) * r2.sqrt() + normal * (1.0 - r2).sqrt();
            !self.tracer.blocked(origin, direction, reach)
        });
        free.count() as f32 / rays as f32
    }

    /// Renders through `camera` at `pose` (camera to world). Colour averages `samples` x `samples`
    /// rays per pixel; depth, labels and facing use the pixel centre.
    pub fn render(&self, camera: &Camera, pose: &Pose, samples: usize) -> PhongImage {
        self.render_lit(camera, pose, samples, self.light)
    }

    /// [`render`](Self::render) with another direction towards the light.
    pub fn render_lit(&self, camera: &Camera, pose: &Pose, samples: usize, light: Option<DVec3>) -> PhongImage {
        let (width, height) = (camera.width, camera.height);
        let samples = samples.max(1);
        let view = View { camera, pose, light: light.and_then(DVec3::try_normalize) };
        let mut frame = PhongImage {
            color: ColorImage::new(width, height, self.background),
            depth: DepthImage::new(width, height),
            labels: vec![0; width * height],
            facing: vec![0.0; width * height],
        };
        if width == 0 {
            return frame;
        }
        let middles = Hits::new(&self.tracer, &view, 1);
        let within = (samples > 1).then(|| Hits::new(&self.tracer, &view, samples));
        let rows = frame.color.pixels.par_chunks_mut(width).zip(frame.depth.depth.par_chunks_mut(width));
        let rows = rows.zip(frame.labels.par_chunks_mut(width)).zip(frame.facing.par_chunks_mut(width));
        rows.enumerate().for_each_init(Row::default, |row, (v, (((color, depth), labels), facing))| {
            middles.row(v, row);
            for u in 0..width {
                let (direction, Some(hit)) = (row.directions[u], &row.hits[u]) else { continue };
                let (instance, _) = self.triangles[hit.triangle as usize];
                depth[u] = hit.t as f32;
                labels[u] = self.looks[instance as usize].0;
                facing[u] = self.flat[hit.triangle as usize].dot(direction.normalize()).abs() as f32;
            }
            let Some(within) = &within else {
                for (color, (direction, hit)) in color.iter_mut().zip(row.directions.iter().zip(&row.hits)) {
                    *color = srgb::from_linear(self.light_of(&view, *direction, *hit));
                }
                return;
            };
            let mut sums = vec![[0.0; 3]; width];
            for j in 0..samples {
                within.row(v * samples + j, row);
                for (k, (direction, hit)) in row.directions.iter().zip(&row.hits).enumerate() {
                    let light = self.light_of(&view, *direction, *hit);
                    // Clip before averaging; otherwise the edge of a highlight stays jagged.
                    (0..3).for_each(|c| sums[k / samples][c] += light[c].min(1.0));
                }
            }
            for (color, sum) in color.iter_mut().zip(sums) {
                *color = srgb::from_linear(sum.map(|s| s / (samples * samples) as f32));
            }
        });
        frame
    }

    /// Linear radiance along `direction`.
    fn light_of(&self, view: &View<'_>, direction: DVec3, hit: Option<Hit>) -> [f32; 3] {
        let Some(hit) = hit else { return srgb::to_linear(self.background) };
        let (instance, corners) = self.triangles[hit.triangle as usize];
        let (_, shading) = self.looks[instance as usize];
        let [a, b, c] = corners.map(|v| v as usize);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];

        let to_eye = -direction.normalize();
        let flat = self.flat[hit.triangle as usize];
        let side = if flat.dot(to_eye) < 0.0 { -1.0 } else { 1.0 };
        let smooth = weights[0] * self.normals[a] + weights[1] * self.normals[b] + weights[2] * self.normals[c];
        let normal = side * smooth.try_normalize().unwrap_or(flat);
        let point = view.pose.translation + direction * hit.t;
        let to_light = view.light.unwrap_or(to_eye);
        let shadowed = view.light.is_some_and(|light| {
            // Offset from the surface by a fraction of the viewing distance, larger than the
            // rounding error of the hit.
            let origin = point + side * flat * (1e-4 * (point - view.pose.translation).length());
            self.tracer.blocked(origin, light, f64::INFINITY)
        });
        let w = weights.map(|w| w as f32);
        let mixed = |of: &dyn Fn(usize) -> f32| w[0] * of(a) + w[1] * of(b) + w[2] * of(c);
        let open = if self.occlusion.is_none() { 1.0 } else { mixed(&|i| self.open(i)) };
        let albedo = [0, 1, 2].map(|k| mixed(&|i| self.albedo[i][k]));
        let light = shade(&Lit { albedo, normal, to_eye, to_light, shadowed, open, gloss: shading.gloss });
        if !shading.wireframe {
            return light;
        }
        let line = self.edge_line(corners, weights, hit.t / view.camera.fx);
        light.map(|l| l * (1.0 - 0.8 * line))
    }

    /// Line intensity: 1 on a triangle's edge, 0 half a pixel away. Each of two neighbours draws
    /// its half of the line.
    fn edge_line(&self, corners: [u32; 3], weights: [f64; 3], pixel: f64) -> f32 {
        let [a, b, c] = corners.map(|v| self.positions[v as usize]);
        let double_area = (b - a).cross(c - a).length();
        let opposite = [b - c, c - a, a - b].map(DVec3::length);
        let nearest = (0..3).map(|k| weights[k] * double_area / opposite[k]).fold(f64::INFINITY, f64::min);
        (1.5 - 1.5 * nearest / pixel).clamp(0.0, 1.0) as f32
    }
}
