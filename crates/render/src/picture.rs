//! Rendering: colour, depth, labels and normals of a stage in one pass.

use crate::eye::Eye;
use crate::film::Film;
use crate::path::{Key, LENS, radiance};
use crate::preview;
use crate::stage::{Stage, Touch, rotation_of};
use crate::tree::Stacks;
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;
use trocar_camera::{ColorImage, DepthImage, Pose};

/// Side of the tiles that a picture is rendered in [px].
const TILE: usize = 8;

/// How light is worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settings {
    /// Direct light at the pixels' centres: for policies and windows.
    Preview {
        /// Cast hard shadows: a second ray a light.
        shadows: bool,
    },
    /// Many paths a pixel: for pictures.
    Path {
        /// Paths a pixel.
        samples: u32,
        /// Most bounces of a path.
        bounces: u32,
        /// Seed; another gives other noise.
        seed: u32,
    },
}

/// A rendered picture, rows from the top. Depth, labels and normals are of the pixels' centres.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Developed colour.
    pub color: ColorImage,
    /// Depth along the camera's z [m]; 0 where nothing is.
    pub depth: DepthImage,
    /// Label of the body; 0 where nothing is.
    pub labels: Vec<u16>,
    /// Unit normals in the camera's frame, towards the camera; 0 where nothing is.
    pub normals: Vec<[f32; 3]>,
    /// Linear radiance before the film.
    pub light: Vec<[f32; 3]>,
}

#[derive(Clone, Copy, Default)]
struct Pixel {
    light: [f32; 3],
    normal: [f32; 3],
    depth: f32,
    label: u16,
}

impl Settings {
    /// Direct light with hard shadows.
    pub fn preview() -> Self {
        Self::Preview { shadows: true }
    }

    /// Paths of up to eight bounces.
    pub fn path(samples: u32) -> Self {
        Self::Path { samples, bounces: 8, seed: 0 }
    }
}

/// The stage seen through `eye` at `pose` (camera to world). The same call gives the same bits for any number of threads and
/// any instruction set.
pub fn render(stage: &mut Stage, eye: &Eye, pose: &Pose, settings: &Settings, film: &Film) -> Picture {
    stage.settle();
    let (width, height) = (eye.width(), eye.height());
    let mut pixels = vec![Pixel::default(); width * height];
    let shot = Shot { stage, eye, rotation: rotation_of(pose), origin: pose.translation.as_vec3a(), settings };
    pixels.par_chunks_mut((width * TILE).max(1)).enumerate().for_each(|(band, rows)| {
        let mut hand = Hand { stacks: Stacks::new(), rays: Vec::new(), directions: Vec::new(), ahead: Vec::new() };
        for left in (0..width).step_by(TILE) {
            shot.tile(rows, band * TILE * width, left..width.min(left + TILE), &mut hand);
        }
    });
    let colors = pixels.par_iter().with_min_len(4096).enumerate().map(|(i, p)| film.develop(eye, i, p.light)).collect();
    Picture {
        color: ColorImage { width, height, pixels: colors },
        depth: DepthImage { width, height, depth: pixels.iter().map(|p| p.depth).collect() },
        labels: pixels.iter().map(|p| p.label).collect(),
        normals: pixels.iter().map(|p| p.normal).collect(),
        light: pixels.iter().map(|p| p.light).collect(),
    }
}

struct Shot<'a> {
    stage: &'a Stage,
    eye: &'a Eye,
    rotation: Mat3A,
    origin: Vec3A,
    settings: &'a Settings,
}

/// What a worker keeps from tile to tile.
struct Hand {
    stacks: Stacks,
    /// Of each pixel of a tile that sees something: its place among the band's pixels, and its ray.
    rays: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
    ahead: Vec<(f32, u32)>,
}

impl Shot<'_> {
    /// Renders the pixels of some columns of a band of rows, whose first pixel is the image's `first`.
    fn tile(&self, band: &mut [Pixel], first: usize, columns: std::ops::Range<usize>, hand: &mut Hand) {
        let width = self.eye.width();
        let Hand { stacks, rays, directions, ahead } = hand;
        rays.clear();
        for row in 0..band.len() / width {
            let pixels = columns.clone().map(|u| row * width + u);
            rays.extend(pixels.filter_map(|i| self.eye.centre(first + i).map(|ray| (i, ray))));
        }
        directions.clear();
        directions.extend(rays.iter().map(|(_, ray)| self.rotation * *ray));
        self.stage.ahead(self.origin, directions, ahead);
        for ((i, ray), direction) in rays.iter().zip(directions.iter()) {
            let touch = self.stage.first_ahead(ahead, self.origin, *direction, stacks);
            band[*i] = self.pixel(first + i, *ray, *direction, touch, stacks);
        }
    }

    /// A pixel whose centre's ray meets `touch`.
    fn pixel(&self, index: usize, ray: Vec3A, direction: Vec3A, touch: Option<Touch>, stacks: &mut Stacks) -> Pixel {
        let mut pixel = Pixel::default();
        let mut direct = Vec3A::from(self.stage.environment);
        if let Some(touch) = touch {
            let surface = self.stage.surface(&touch, direction);
            pixel.depth = (touch.t * ray.z).max(0.0);
            pixel.label = self.stage.label(&touch);
            pixel.normal = (self.rotation.transpose() * surface.smooth).to_array();
            if let Settings::Preview { shadows } = *self.settings {
                let to_eye = -direction.normalize();
                direct = preview::light(self.stage, &surface, self.stage.material(&touch), to_eye, shadows, stacks);
            }
        }
        pixel.light = match *self.settings {
            Settings::Preview { .. } => direct.to_array(),
            Settings::Path { samples, bounces, seed } => {
                let mut sum = Vec3A::ZERO;
                let samples = samples.max(1);
                for sample in 0..samples {
                    let key = Key { seed, pixel: index as u32, sample };
                    let [a, b, ..] = key.draw(0, LENS);
                    if let Some(ray) = self.eye.within(index, a, b) {
                        sum += radiance(self.stage, self.origin, self.rotation * ray, bounces, key, stacks);
                    }
                }
                (sum / samples as f32).to_array()
            }
        };
        pixel
    }
}
