//! Rendering: colour, depth, labels and normals of a stage in one pass.

use crate::bvh::Stacks;
use crate::film::Film;
use crate::path::{Key, LENS, radiance};
use crate::preview::{self, ShadowBuffers, VisiblePoint};
use crate::rays::RayGenerator;
use crate::stage::{BundleCandidates, Stage, rotation_of};
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;
use trocar_camera::{ColorImage, DepthImage};
use trocar_core::Pose;

/// Side of a tile (px). A picture is rendered tile by tile.
const TILE: usize = 8;

/// Limit on the radiance of one path. Rare paths that meet a light in a mirror by chance give white
/// dots in a picture of a hundred paths per pixel (firefly clamping). The light that is lost is
/// beyond any film's range.
const MAX_PATH_RADIANCE: f32 = 24.0;

/// How light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderSettings {
    /// Direct light at pixel centres: for policies and live views.
    Preview {
        /// Casts hard shadows with a second ray per light.
        shadows: bool,
    },
    /// Path tracing: for publication pictures.
    Path {
        /// Paths per pixel.
        samples: u32,
        /// Maximum number of bounces per path.
        bounces: u32,
        /// Seed of the noise.
        seed: u32,
    },
}

/// A rendered picture, rows from the top. Depth, labels and normals are taken at pixel centres.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Colour after exposure and tone mapping by the film.
    pub color: ColorImage,
    /// Depth along the camera's z axis (m); 0 where no body is visible.
    pub depth: DepthImage,
    /// Label of the visible body; 0 where no body is visible.
    pub labels: Vec<u16>,
    /// Unit normals in the camera frame, towards the camera; 0 where no body is visible.
    pub normals: Vec<[f32; 3]>,
    /// Linear radiance before the film is applied.
    pub light: Vec<[f32; 3]>,
}

#[derive(Clone, Copy, Default)]
struct Pixel {
    light: [f32; 3],
    normal: [f32; 3],
    depth: f32,
    label: u16,
}

impl RenderSettings {
    /// Direct light with hard shadows.
    pub fn preview() -> Self {
        Self::Preview { shadows: true }
    }

    /// Path tracing with at most eight bounces.
    pub fn path(samples: u32) -> Self {
        Self::Path { samples, bounces: 8, seed: 0 }
    }
}

impl Picture {
    /// A black picture in which no body is visible.
    pub fn new(width: usize, height: usize) -> Self {
        let mut picture = Self::default();
        picture.resize(width, height);
        picture
    }

    fn resize(&mut self, width: usize, height: usize) {
        let count = width * height;
        (self.color.width, self.color.height) = (width, height);
        (self.depth.width, self.depth.height) = (width, height);
        self.color.pixels.resize(count, [0; 3]);
        self.depth.depth.resize(count, 0.0);
        self.labels.resize(count, 0);
        self.normals.resize(count, [0.0; 3]);
        self.light.resize(count, [0.0; 3]);
    }
}

impl Default for Picture {
    fn default() -> Self {
        Self {
            color: ColorImage::new(0, 0, [0; 3]),
            depth: DepthImage::new(0, 0),
            labels: Vec::new(),
            normals: Vec::new(),
            light: Vec::new(),
        }
    }
}

/// Renders the stage through `rays` at `pose` (camera to world). The result is bit-identical for
/// any number of threads and any instruction set.
pub fn render(stage: &mut Stage, rays: &RayGenerator, pose: &Pose, settings: &RenderSettings, film: &Film) -> Picture {
    let mut picture = Picture::default();
    render_into(&mut picture, stage, rays, pose, settings, film);
    picture
}

/// Like [`render`], but reuses `picture`. No memory is allocated for it if the size stays the same.
pub fn render_into(
    picture: &mut Picture,
    stage: &mut Stage,
    rays: &RayGenerator,
    pose: &Pose,
    settings: &RenderSettings,
    film: &Film,
) {
    stage.update_acceleration();
    let (width, height) = (rays.width(), rays.height());
    picture.resize(width, height);
    let shot =
        Shot { stage, camera_rays: rays, rotation: rotation_of(pose), origin: pose.translation.as_vec3a(), settings };
    let band = (width * TILE).max(1);
    let rows = (
        picture.color.pixels.par_chunks_mut(band),
        picture.depth.depth.par_chunks_mut(band),
        picture.labels.par_chunks_mut(band),
        picture.normals.par_chunks_mut(band),
        picture.light.par_chunks_mut(band),
    );
    rows.into_par_iter().enumerate().for_each_init(
        TileBuffers::new,
        |buffers, (k, (color, depth, label, normal, light))| {
            let first = k * band;
            buffers.pixels.clear();
            buffers.pixels.resize(color.len(), Pixel::default());
            for left in (0..width).step_by(TILE) {
                shot.tile(first, left..width.min(left + TILE), buffers);
            }
            for (i, pixel) in buffers.pixels.iter().enumerate() {
                color[i] = film.develop(rays, first + i, pixel.light);
                (depth[i], label[i], normal[i], light[i]) = (pixel.depth, pixel.label, pixel.normal, pixel.light);
            }
        },
    );
}

struct Shot<'a> {
    stage: &'a Stage,
    camera_rays: &'a RayGenerator,
    rotation: Mat3A,
    origin: Vec3A,
    settings: &'a RenderSettings,
}

/// Buffers that a thread reuses from tile to tile.
struct TileBuffers {
    stacks: Stacks,
    /// Pixels of the current band of rows.
    pixels: Vec<Pixel>,
    /// For each pixel of the tile with a ray: its index in the band, and its ray in the camera
    /// frame.
    rays: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
    candidates: BundleCandidates,
    /// Preview only: the visible surface points, and their pixels in the band.
    visible: Vec<VisiblePoint>,
    pixel_indices: Vec<usize>,
    shadow_buffers: ShadowBuffers,
}

impl TileBuffers {
    fn new() -> Self {
        let (pixels, rays, directions) = (Vec::new(), Vec::new(), Vec::new());
        let (candidates, shadow_buffers) = (BundleCandidates::default(), ShadowBuffers::default());
        Self {
            stacks: Stacks::new(),
            pixels,
            rays,
            directions,
            candidates,
            visible: Vec::new(),
            pixel_indices: Vec::new(),
            shadow_buffers,
        }
    }
}

impl Shot<'_> {
    /// Renders the pixels in `columns` of a band of rows. `first` is the index of the band's first
    /// pixel.
    fn tile(&self, first: usize, columns: std::ops::Range<usize>, buffers: &mut TileBuffers) {
        let width = self.camera_rays.width();
        let TileBuffers { stacks, pixels: band, rays, directions, candidates, visible, pixel_indices, shadow_buffers } =
            buffers;
        rays.clear();
        for row in 0..band.len() / width {
            let pixels = columns.clone().map(|u| row * width + u);
            rays.extend(pixels.filter_map(|i| self.camera_rays.centre(first + i).map(|ray| (i, ray))));
        }
        directions.clear();
        directions.extend(rays.iter().map(|(_, ray)| self.rotation * *ray));
        self.stage.collect_bundle(self.origin, directions, candidates);
        visible.clear();
        pixel_indices.clear();
        let to_camera = self.rotation.transpose();
        for ((i, ray), direction) in rays.iter().zip(directions.iter()) {
            let pixel = &mut band[*i];
            pixel.light = self.stage.environment;
            if let Some(hit) = self.stage.first_of_bundle(candidates, self.origin, *direction, stacks) {
                let surface = self.stage.surface(&hit, *direction);
                pixel.depth = (hit.t * ray.z).max(0.0);
                pixel.label = self.stage.label(&hit);
                pixel.normal = (to_camera * surface.smooth).to_array();
                pixel_indices.push(*i);
                visible.push(VisiblePoint::new(self.stage, hit, surface, *direction));
            }
        }
        match *self.settings {
            RenderSettings::Preview { shadows } => {
                preview::light(self.stage, self.origin, visible, shadows, shadow_buffers, stacks);
                for (i, visible) in pixel_indices.iter().zip(visible.iter()) {
                    band[*i].light = visible.light.to_array();
                }
            }
            RenderSettings::Path { samples, bounces, seed } => {
                for (i, _) in rays.iter() {
                    let key = |sample| Key { seed, pixel: (first + i) as u32, sample };
                    let mut sum = Vec3A::ZERO;
                    for sample in 0..samples.max(1) {
                        let key = key(sample);
                        let [a, b, ..] = key.draw(0, LENS);
                        if let Some(ray) = self.camera_rays.at(first + i, a, b) {
                            let light = radiance(self.stage, self.origin, self.rotation * ray, bounces, key, stacks);
                            sum += light * (MAX_PATH_RADIANCE / light.max_element().max(MAX_PATH_RADIANCE));
                        }
                    }
                    band[*i].light = (sum / samples.max(1) as f32).to_array();
                }
            }
        }
    }
}
