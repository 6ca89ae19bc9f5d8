//! Rendering a stage: rasterised, with a ray per pixel, or with many paths per pixel.

use crate::antialias::MAX_SIDE;
use crate::bvh::Stacks;
use crate::denoise::{Guide, denoise};
use crate::direct::{self, ShadowBuffers, VisiblePoint};
use crate::film::Film;
use crate::path::{FirstHit, radiance};
use crate::picture::{Picture, Rows};
use crate::preview::preview;
use crate::raster::View;
use crate::rays::{RayGenerator, TILE};
use crate::samples::{PixelSamples, Purpose};
use crate::stage::{BundleCandidates, Stage, rotation_of};
use glam::Vec3A;
use rayon::prelude::*;
use trocar_core::Pose;

/// Limit on the radiance of one path. Rare paths that meet a light in a mirror by chance give white
/// dots in a picture of a hundred paths per pixel (firefly clamping). The light that is lost is
/// beyond any film's range.
const MAX_PATH_RADIANCE: f32 = 24.0;

/// How light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderSettings {
    /// Direct light at pixel centres, rasterised: for policies and live views.
    Preview {
        /// Casts hard shadows with a ray per light.
        shadows: bool,
    },
    /// [`Preview`](Self::Preview) with shadows and smooth edges: for films and reports. A pixel
    /// that differs from a neighbour has the mean colour of four points. A picture with noise of
    /// the film, or of more than 4096 pixels a side, is a preview.
    Smooth,
    /// The same light on what a ray per pixel hits: the reference for `Preview`.
    Traced {
        /// Casts hard shadows with a ray per light.
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
        /// Filters the noise out, guided by the surfaces that the paths see first. Detail of light
        /// that is weaker than the noise goes with it.
        denoise: bool,
    },
}

impl RenderSettings {
    /// Direct light with hard shadows.
    pub fn preview() -> Self {
        Self::Preview { shadows: true }
    }

    /// Path tracing with at most eight bounces, without a filter.
    pub fn path(samples: u32) -> Self {
        Self::Path { samples, bounces: 8, seed: 0, denoise: false }
    }

    /// Path tracing with at most eight bounces, whose noise is filtered out.
    pub fn denoised(samples: u32) -> Self {
        Self::Path { samples, bounces: 8, seed: 0, denoise: true }
    }
}

/// Renders the stage through `rays` at `pose` (camera to world). The result is bit-identical for
/// any number of threads and any instruction set.
pub fn render(stage: &mut Stage, rays: &RayGenerator, pose: &Pose, settings: &RenderSettings, film: &Film) -> Picture {
    let mut picture = Picture::default();
    render_into(&mut picture, stage, rays, pose, settings, film);
    picture
}

/// Like [`render`], but reuses `picture`. Little memory is allocated if the size stays the same.
///
/// The stage keeps what previews show of bodies at rest, for the last cameras that it was seen
/// through. So previews are quick for a camera that stands still. They have the same bits as if
/// nothing were kept.
pub fn render_into(
    picture: &mut Picture,
    stage: &mut Stage,
    rays: &RayGenerator,
    pose: &Pose,
    settings: &RenderSettings,
    film: &Film,
) {
    picture.resize(rays.width(), rays.height());
    stage.update_lamps();
    let view = View { rays, rotation: rotation_of(pose), origin: pose.translation.as_vec3a() };
    let rasterised = match *settings {
        RenderSettings::Preview { shadows } => Some((shadows, false)),
        RenderSettings::Smooth => Some((true, film.noise.is_none() && rays.width().max(rays.height()) <= MAX_SIDE)),
        RenderSettings::Traced { .. } | RenderSettings::Path { .. } => None,
    };
    if let Some(kind) = rasterised {
        preview(picture, stage, &view, kind, film);
        return;
    }
    stage.update_acceleration();
    let filters = matches!(settings, RenderSettings::Path { denoise: true, .. });
    let (width, shot) = (rays.width(), Shot { stage, view, settings });
    let mut guides = vec![Guide::default(); if filters { width * rays.height() } else { 0 }];
    let mut guided: Vec<&mut [Guide]> = guides.chunks_mut((width * TILE).max(1)).collect();
    guided.resize_with(rays.height().div_ceil(TILE), Default::default);
    picture.bands(width * TILE).zip(guided).for_each_init(TileBuffers::new, |buffers, ((k, mut rows), guides)| {
        for left in (0..width).step_by(TILE) {
            shot.tile(k * TILE, left, (&mut rows, &mut *guides), buffers);
        }
        if !filters {
            rows.develop(film, rays, k * TILE);
        }
    });
    if filters {
        denoise(&guides, width, &mut picture.light);
        picture.bands(width * TILE).for_each(|(k, mut rows)| rows.develop(film, rays, k * TILE));
    }
}

struct Shot<'a> {
    stage: &'a Stage,
    view: View<'a>,
    settings: &'a RenderSettings,
}

/// Buffers that a thread reuses from tile to tile.
struct TileBuffers {
    stacks: Stacks,
    /// For each pixel of the tile with a ray: its index in the band, and its ray in the camera
    /// frame.
    rays: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
    candidates: BundleCandidates,
    /// Direct light only: the visible surface points, and their pixels in the band.
    visible: Vec<VisiblePoint>,
    pixel_indices: Vec<usize>,
    shadow_buffers: ShadowBuffers,
}

impl TileBuffers {
    fn new() -> Self {
        Self {
            stacks: Stacks::new(),
            rays: Vec::new(),
            directions: Vec::new(),
            candidates: BundleCandidates::default(),
            visible: Vec::new(),
            pixel_indices: Vec::new(),
            shadow_buffers: ShadowBuffers::default(),
        }
    }
}

impl Shot<'_> {
    /// Renders the pixels of a tile whose first row is `first` and whose first column is `left`.
    fn tile(
        &self,
        first: usize,
        left: usize,
        (rows, guides): (&mut Rows<'_>, &mut [Guide]),
        buffers: &mut TileBuffers,
    ) {
        let Self { stage, view, settings } = self;
        let width = view.rays.width();
        let TileBuffers { stacks, rays, directions, candidates, visible, pixel_indices, shadow_buffers } = buffers;
        rays.clear();
        for row in 0..rows.depth.len() / width {
            for u in left..width.min(left + TILE) {
                let i = row * width + u;
                (rows.depth[i], rows.labels[i]) = (0.0, 0);
                (rows.normals[i], rows.light[i]) = ([0.0; 3], [0.0; 3]);
                rays.extend(view.rays.centre(first * width + i).map(|ray| (i, ray)));
            }
        }
        directions.clear();
        directions.extend(rays.iter().map(|(_, ray)| view.rotation * *ray));
        stage.collect_bundle(view.origin, directions, candidates);
        visible.clear();
        pixel_indices.clear();
        let to_camera = view.rotation.transpose();
        for ((i, ray), direction) in rays.iter().zip(directions.iter()) {
            rows.light[*i] = stage.environment;
            if let Some(hit) = stage.first_of_bundle(candidates, view.origin, *direction, stacks) {
                let surface = stage.surface(&hit, *direction);
                rows.depth[*i] = (hit.t * ray.z).max(0.0);
                rows.labels[*i] = stage.label(&hit);
                rows.normals[*i] = (to_camera * surface.smooth).to_array();
                pixel_indices.push(*i);
                visible.push(VisiblePoint::new(stage, hit, surface, *direction));
            }
        }
        if let RenderSettings::Path { samples, bounces, seed, .. } = **settings {
            for (i, _) in rays.iter() {
                let pixel = PixelSamples::new((first * width + i) as u32, seed);
                let (light, guide) = self.pixel(first * width + i, pixel, (samples.max(1), bounces), stacks);
                rows.light[*i] = light.to_array();
                if let Some(to) = guides.get_mut(*i) {
                    *to = guide;
                }
            }
            return;
        }
        let shadows = matches!(settings, RenderSettings::Traced { shadows: true });
        direct::light(stage, view.origin, visible, shadows, shadow_buffers, stacks);
        for (i, visible) in pixel_indices.iter().zip(visible.iter()) {
            rows.light[*i] = visible.light.to_array();
        }
    }

    /// The mean of a pixel's paths, and what guides the filter.
    fn pixel(
        &self,
        index: usize,
        pixel: PixelSamples,
        (samples, bounces): (u32, u32),
        stacks: &mut Stacks,
    ) -> (Vec3A, Guide) {
        let Self { stage, view, .. } = self;
        let (mut halves, [mut albedo, mut normal, mut place]) = ([Vec3A::ZERO; 2], [Vec3A::ZERO; 3]);
        let mut first = FirstHit { albedo, normal, place };
        let early = samples.div_ceil(2);
        for number in 0..samples {
            let sample = pixel.sample(number);
            let [a, b, ..] = sample.draw(Purpose::Lens);
            let Some(ray) = view.rays.at(index, a, b) else { continue };
            let found = radiance(stage, view.origin, view.rotation * ray, bounces, sample, &mut first, stacks);
            let dimmed = found * (MAX_PATH_RADIANCE / found.max_element().max(MAX_PATH_RADIANCE));
            halves[usize::from(number >= early)] += dimmed;
            albedo += first.albedo;
            normal += first.normal;
            place += first.place;
        }
        let light = (halves[0] + halves[1]) / samples as f32;
        let [a, b] = [halves[0] / early as f32, halves[1] / (samples - early).max(1) as f32];
        let halves = [a, if samples > 1 { b } else { a }].map(|half| half.to_array());
        let mean = |sum: Vec3A| (sum / samples as f32).to_array();
        (light, Guide { halves, albedo: mean(albedo), normal: mean(normal), place: mean(place) })
    }
}
