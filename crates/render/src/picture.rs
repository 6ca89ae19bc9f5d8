//! Rendering: colour, depth, labels and normals of a stage in one pass.

use crate::eye::Eye;
use crate::film::Film;
use crate::path::{Key, LENS, radiance};
use crate::preview::{self, Seen, Shades};
use crate::stage::{Ahead, Stage, rotation_of};
use crate::tree::Stacks;
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;
use trocar_camera::{ColorImage, DepthImage};
use trocar_core::Pose;

/// Side of the tiles that a picture is rendered in [px].
const TILE: usize = 8;

/// A path that brings more than so many times white is dimmed to it: one in ten thousand that meets a light in a mirror by chance
/// would be a white dot in a picture of a hundred paths a pixel. (Firefly clamping; it loses what no film shows.)
const BRIGHTEST: f32 = 24.0;

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

impl Picture {
    /// A black picture of nothing.
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

/// The stage seen through `eye` at `pose` (camera to world). The same call gives the same bits for any number of threads and
/// any instruction set.
pub fn render(stage: &mut Stage, eye: &Eye, pose: &Pose, settings: &Settings, film: &Film) -> Picture {
    let mut picture = Picture::default();
    render_into(&mut picture, stage, eye, pose, settings, film);
    picture
}

/// [`render`] into a picture that is there: of the same size it is written over, and nothing is allocated for it.
pub fn render_into(picture: &mut Picture, stage: &mut Stage, eye: &Eye, pose: &Pose, settings: &Settings, film: &Film) {
    stage.settle();
    let (width, height) = (eye.width(), eye.height());
    picture.resize(width, height);
    let shot = Shot { stage, eye, rotation: rotation_of(pose), origin: pose.translation.as_vec3a(), settings };
    let band = (width * TILE).max(1);
    let rows = (
        picture.color.pixels.par_chunks_mut(band),
        picture.depth.depth.par_chunks_mut(band),
        picture.labels.par_chunks_mut(band),
        picture.normals.par_chunks_mut(band),
        picture.light.par_chunks_mut(band),
    );
    rows.into_par_iter().enumerate().for_each_init(Hand::new, |hand, (k, (color, depth, label, normal, light))| {
        let first = k * band;
        hand.pixels.clear();
        hand.pixels.resize(color.len(), Pixel::default());
        for left in (0..width).step_by(TILE) {
            shot.tile(first, left..width.min(left + TILE), hand);
        }
        for (i, pixel) in hand.pixels.iter().enumerate() {
            color[i] = film.develop(eye, first + i, pixel.light);
            (depth[i], label[i], normal[i], light[i]) = (pixel.depth, pixel.label, pixel.normal, pixel.light);
        }
    });
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
    /// The band's pixels.
    pixels: Vec<Pixel>,
    /// Of each pixel of a tile that sees something: its place among the band's pixels, and its ray.
    rays: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
    ahead: Ahead,
    /// Of a preview: what is seen of the stage, and where among the band's pixels.
    seen: Vec<Seen>,
    places: Vec<usize>,
    shades: Shades,
}

impl Hand {
    fn new() -> Self {
        let (pixels, rays, directions) = (Vec::new(), Vec::new(), Vec::new());
        let (ahead, shades) = (Ahead::default(), Shades::default());
        Self { stacks: Stacks::new(), pixels, rays, directions, ahead, seen: Vec::new(), places: Vec::new(), shades }
    }
}

impl Shot<'_> {
    /// Renders the pixels of some columns of a band of rows, whose first pixel is the image's `first`.
    fn tile(&self, first: usize, columns: std::ops::Range<usize>, hand: &mut Hand) {
        let width = self.eye.width();
        let Hand { stacks, pixels: band, rays, directions, ahead, seen, places, shades } = hand;
        rays.clear();
        for row in 0..band.len() / width {
            let pixels = columns.clone().map(|u| row * width + u);
            rays.extend(pixels.filter_map(|i| self.eye.centre(first + i).map(|ray| (i, ray))));
        }
        directions.clear();
        directions.extend(rays.iter().map(|(_, ray)| self.rotation * *ray));
        self.stage.ahead(self.origin, directions, ahead);
        seen.clear();
        places.clear();
        let to_camera = self.rotation.transpose();
        for ((i, ray), direction) in rays.iter().zip(directions.iter()) {
            let pixel = &mut band[*i];
            pixel.light = self.stage.environment;
            if let Some(touch) = self.stage.first_ahead(ahead, self.origin, *direction, stacks) {
                let surface = self.stage.surface(&touch, *direction);
                pixel.depth = (touch.t * ray.z).max(0.0);
                pixel.label = self.stage.label(&touch);
                pixel.normal = (to_camera * surface.smooth).to_array();
                places.push(*i);
                seen.push(Seen::new(self.stage, touch, surface, *direction));
            }
        }
        match *self.settings {
            Settings::Preview { shadows } => {
                preview::light(self.stage, self.origin, seen, shadows, shades, stacks);
                for (i, seen) in places.iter().zip(seen.iter()) {
                    band[*i].light = seen.light.to_array();
                }
            }
            Settings::Path { samples, bounces, seed } => {
                for (i, _) in rays.iter() {
                    let key = |sample| Key { seed, pixel: (first + i) as u32, sample };
                    let mut sum = Vec3A::ZERO;
                    for sample in 0..samples.max(1) {
                        let key = key(sample);
                        let [a, b, ..] = key.draw(0, LENS);
                        if let Some(ray) = self.eye.within(first + i, a, b) {
                            let light = radiance(self.stage, self.origin, self.rotation * ray, bounces, key, stacks);
                            sum += light * (BRIGHTEST / light.max_element().max(BRIGHTEST));
                        }
                    }
                    band[*i].light = (sum / samples.max(1) as f32).to_array();
                }
            }
        }
    }
}
