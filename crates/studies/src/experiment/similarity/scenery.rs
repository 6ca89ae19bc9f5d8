//! The scene of a recording as a stage: organs and surroundings, with albedos estimated from the
//! photograph and its light.

use super::fill::{Sparse, fill};
use crate::{Error, Result};
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_reconstruct::Reconstruction;
use trocar_render::{Appearance, Film, Light, Picture, RayGenerator, RenderSettings, Stage, render, srgb};

/// Maximum number of triangles of the organs after subdivision.
const MAX_TRIANGLES: usize = 3_000_000;
/// Pixels between vertices of the surroundings.
const STEP: usize = 2;
/// Depth of the unknown surface under the organs below the surroundings (m), so that it does not
/// show through the rim of an organ.
const DEPTH_UNDER_ORGANS: f64 = 3e-3;
/// A vertex gets the colour of the photograph if it is within this distance of the visible front
/// (m).
const FRONT_DISTANCE: f64 = 2e-3;
/// Minimum cosine of the angle of incidence: at grazing angles the photograph says little about the
/// albedo.
const MIN_COSINE: f64 = 0.2;
/// Distance of the endoscope's light from its lens (m).
pub(super) const BESIDE_LENS: f64 = 0.006;
/// Albedo of the 99.5th percentile of brightness.
const BRIGHTEST: f64 = 0.9;

/// The light of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Illumination {
    /// A lamp beside the lens, at this distance towards the top of the picture (m); its light falls
    /// off with the squared distance.
    Lamp { beside: f64 },
    /// Uniform, as in a room.
    Room,
}

/// Organs and surroundings in the recording frame; their colours are albedos.
#[derive(Clone)]
pub(super) struct Scenery {
    organs: Vec<TriMesh>,
    around: TriMesh,
    pub camera: Camera,
    illumination: Illumination,
    /// Radiant intensity of the lamp that reproduces the photograph from the albedos: radiance
    /// times square metres.
    power: f64,
}

impl Scenery {
    pub fn new(made: &Reconstruction, illumination: Illumination) -> Result<Self> {
        let Some(camera) = made.specimen.camera else {
            return Err(Error::Mismatch(format!("'{}' has no recording camera", made.specimen.name)));
        };
        let coarse: Vec<TriMesh> = made.specimen.organs.iter().map(|o| o.surface.clone()).collect();
        let seen = silhouettes(&coarse, &camera, &Pose::IDENTITY)?;
        let photo = &made.composite.color;
        let total: usize = coarse.iter().map(|m| m.triangles.len()).sum();
        // Two subdivisions reduce a triangle of 1.5 mm to a pixel at 0.17 m.
        let splits = if 16 * total <= MAX_TRIANGLES { 2 } else { usize::from(4 * total <= MAX_TRIANGLES) };
        let mut organs = coarse;
        for (k, mesh) in organs.iter_mut().enumerate() {
            (0..splits).for_each(|_| split(mesh));
            project(mesh, k as u16 + 1, photo, &seen, &camera);
        }
        let mut around = surroundings(photo, &made.composite.depth, made.organs.iter().map(|o| &o.mask), &camera);
        let power = match illumination {
            Illumination::Room => 0.0,
            Illumination::Lamp { beside } => {
                let lamp = DVec3::new(0.0, -beside, 0.0);
                let meshes = || organs.iter().chain([&around]);
                let light: Vec<Vec<[f64; 3]>> = meshes().map(|m| albedos(m, lamp)).collect();
                let mut all: Vec<f64> = light.iter().flatten().map(|c| c[0].max(c[1]).max(c[2])).collect();
                all.sort_unstable_by(f64::total_cmp);
                let bright = all.get(all.len().saturating_sub(1) * 199 / 200).copied().unwrap_or(1.0).max(1e-12);
                let scale = BRIGHTEST / bright;
                for (mesh, light) in organs.iter_mut().chain([&mut around]).zip(&light) {
                    mesh.colors = light.iter().map(|c| srgb::from_linear(c.map(|v| (v * scale) as f32))).collect();
                }
                // A matte albedo a has radiance a / pi * power * cos / distance^2.
                PI / scale
            }
        };
        Ok(Self { organs, around, camera, illumination, power })
    }

    /// The vertices of an organ (m).
    pub fn vertices(&self, organ: usize) -> &[DVec3] {
        &self.organs[organ].vertices
    }

    /// The scenery with the vertices of an organ at other places (m).
    #[must_use]
    pub fn with(&self, organ: usize, vertices: Vec<DVec3>) -> Self {
        let mut moved = self.clone();
        moved.organs[organ].vertices = vertices;
        moved
    }

    /// Labels of the organs through `camera` at the recording camera's pose: index + 1.
    pub fn labels(&self, camera: &Camera) -> Result<Vec<u16>> {
        self.labels_from(camera, &Pose::IDENTITY)
    }

    /// The same through `camera` at `pose`.
    pub fn labels_from(&self, camera: &Camera, pose: &Pose) -> Result<Vec<u16>> {
        Ok(silhouettes(&self.organs, camera, pose)?.labels)
    }

    /// The scene through `camera` at the recording camera's pose, in the light of the recording.
    pub fn picture(&self, camera: &Camera, samples: u32) -> Result<ColorImage> {
        let mut stage = self.stage(false)?;
        match self.illumination {
            Illumination::Room => stage.environment = [1.0; 3],
            Illumination::Lamp { beside } => stage.lights.push(Light::Spot {
                position: DVec3::new(0.0, -beside, 0.0),
                direction: DVec3::Z,
                intensity: [self.power as f32; 3],
                inner: PI,
                outer: PI,
            }),
        }
        let settings = RenderSettings::Path { samples, bounces: 3, seed: 1, denoise: false };
        Ok(render(&mut stage, &RayGenerator::new(*camera), &Pose::IDENTITY, &settings, &Film::default()).color)
    }

    /// The wet scene through `camera` at `pose`, in the light of an endoscope. A white surface at
    /// distance `white_at` (m) is rendered white.
    pub fn through_endoscope(&self, camera: &Camera, pose: &Pose, white_at: f64, samples: u32) -> Result<ColorImage> {
        let mut stage = self.stage(true)?;
        stage.lights.push(Light::endoscope(pose, BESIDE_LENS, white_at));
        let settings = RenderSettings::Path { samples, bounces: 4, seed: 1, denoise: false };
        Ok(render(&mut stage, &RayGenerator::new(*camera), pose, &settings, &Film::endoscope()).color)
    }

    fn stage(&self, wet: bool) -> Result<Stage> {
        let look = |color| if wet { Appearance::tissue(color) } else { Appearance::matte(color) };
        let mut stage = Stage::new();
        for (k, mesh) in self.organs.iter().enumerate() {
            stage.add_mesh(mesh, k as u16 + 1, &look([150, 60, 55]))?;
        }
        stage.add_mesh(&self.around, self.organs.len() as u16 + 1, &look([120; 3]))?;
        Ok(stage)
    }
}

/// The organs through a camera at `pose`, without light.
pub(super) fn silhouettes(organs: &[TriMesh], camera: &Camera, pose: &Pose) -> Result<Picture> {
    let mut stage = Stage::new();
    for (k, mesh) in organs.iter().enumerate() {
        stage.add_mesh(mesh, k as u16 + 1, &Appearance::matte([150; 3]))?;
    }
    let settings = RenderSettings::Preview { shadows: false };
    Ok(render(&mut stage, &RayGenerator::new(*camera), pose, &settings, &Film::default()))
}

/// Subdivides all triangles: halves every edge.
fn split(mesh: &mut TriMesh) {
    let mut middle: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let colored = mesh.colors.len() == mesh.vertices.len();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for t in std::mem::take(&mut mesh.triangles) {
        let [ab, bc, ca] = [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[i, j]| {
            *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                let (i, j) = (i as usize, j as usize);
                mesh.vertices.push(0.5 * (mesh.vertices[i] + mesh.vertices[j]));
                if colored {
                    let (a, b) = (mesh.colors[i], mesh.colors[j]);
                    mesh.colors.push([0, 1, 2].map(|c| a[c].midpoint(b[c])));
                }
                (mesh.vertices.len() - 1) as u32
            })
        });
        triangles.extend([[t[0], ab, ca], [t[1], bc, ab], [t[2], ca, bc], [ab, bc, ca]]);
    }
    mesh.triangles = triangles;
}

/// Colours the vertices that the camera sees from the photograph by bilinear interpolation; others
/// keep their colours.
fn project(mesh: &mut TriMesh, label: u16, photo: &ColorImage, seen: &Picture, camera: &Camera) {
    let (w, h) = (photo.width, photo.height);
    mesh.colors.resize(mesh.vertices.len(), [150, 60, 55]);
    for (p, color) in mesh.vertices.iter().zip(&mut mesh.colors) {
        let Some(q) = camera.project(*p) else { continue };
        if !(q.x >= 0.0 && q.y >= 0.0 && q.x <= w as f64 - 1.0 && q.y <= h as f64 - 1.0) {
            continue;
        }
        let nearest = q.y.round() as usize * w + q.x.round() as usize;
        if seen.labels[nearest] != label || (f64::from(seen.depth.depth[nearest]) - p.z).abs() > FRONT_DISTANCE {
            continue;
        }
        let (x, y) = (q.x as usize, q.y as usize);
        let (a, b) = (q.x - x as f64, q.y - y as f64);
        let at = |i: usize, j: usize| j.min(h - 1) * w + i.min(w - 1);
        let corners = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        // Black pixels of the composite are unknown; neighbouring pixels may belong to other
        // organs.
        if corners.iter().any(|i| photo.pixels[*i] == [0; 3] || seen.labels[*i] != label) {
            let here = photo.pixels[nearest];
            if here != [0; 3] {
                *color = here;
            }
            continue;
        }
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        *color = std::array::from_fn(|c| {
            corners.iter().zip(weights).map(|(i, w)| w * f64::from(photo.pixels[*i][c])).sum::<f64>().round() as u8
        });
    }
}

/// Albedos up to a common factor: the light of the photograph over that of a matte white surface
/// lit by a lamp of power 1 at `lamp`.
fn albedos(mesh: &TriMesh, lamp: DVec3) -> Vec<[f64; 3]> {
    let mut normals = vec![DVec3::ZERO; mesh.vertices.len()];
    for t in 0..mesh.triangles.len() {
        let area = mesh.area_vector(t);
        mesh.triangles[t].iter().for_each(|v| normals[*v as usize] += area);
    }
    let color = |i: usize| {
        let to_lamp = lamp - mesh.vertices[i];
        let cos = normals[i].normalize_or_zero().dot(to_lamp.normalize_or_zero()).abs().max(MIN_COSINE);
        srgb::to_linear(mesh.colors[i]).map(|l| f64::from(l) * to_lamp.length_squared() / cos)
    };
    (0..mesh.vertices.len()).map(color).collect()
}

/// The surroundings of the organs as a height field over the image: depth and colour of the
/// composite, smoothed, and filled under the organs and at unknown pixels.
pub(super) fn surroundings<'a>(
    photo: &ColorImage,
    depth: &DepthImage,
    organs: impl Iterator<Item = &'a Mask>,
    camera: &Camera,
) -> TriMesh {
    let (w, h) = (photo.width, photo.height);
    let mut covered = vec![false; w * h];
    for mask in organs {
        covered.iter_mut().zip(&mask.set).for_each(|(c, set)| *c |= set);
    }
    let filled = fill(&Sparse {
        width: w,
        height: h,
        // A plane is linear in 1/z.
        values: depth.depth.iter().map(|z| [1.0 / f64::from(*z).max(1e-3)]).collect(),
        known: (0..w * h).map(|i| !covered[i] && depth.depth[i] > 0.0).collect(),
    });
    let mut nearness: Vec<f64> = filled.iter().map(|n| n[0]).collect();
    for _ in 0..8 {
        let from = nearness.clone();
        for v in 1..h.saturating_sub(1) {
            for u in 1..w - 1 {
                let i = v * w + u;
                let near = [from[i - 1], from[i + 1], from[i - w], from[i + w]];
                // Differences of more than 2% are edges.
                let neighbours = near.iter().filter(|n| (**n - from[i]).abs() < 0.02 * from[i]);
                let (sum, count) = neighbours.fold((from[i], 1.0), |(s, c), n| (s + n, c + 1.0));
                nearness[i] = sum / count;
            }
        }
    }
    let color = fill(&Sparse {
        width: w,
        height: h,
        values: photo.pixels.iter().map(|p| p.map(f64::from)).collect(),
        known: (0..w * h).map(|i| !covered[i] && photo.pixels[i] != [0; 3]).collect(),
    });
    let mut mesh = TriMesh::default();
    let (columns, rows) = (w.div_ceil(STEP), h.div_ceil(STEP));
    for i in 0..columns * rows {
        let (u, v) = (i % columns * STEP, i / columns * STEP);
        let at = v * w + u;
        let z = 1.0 / nearness[at].max(1e-3) + if covered[at] { DEPTH_UNDER_ORGANS } else { 0.0 };
        mesh.vertices.push(camera.ray(u as f64, v as f64) * z);
        mesh.colors.push(color[at].map(|c| c.round() as u8));
    }
    for y in 1..rows {
        for x in 1..columns {
            let [a, b, c, d] = [(y - 1) * columns + x - 1, (y - 1) * columns + x, y * columns + x, y * columns + x - 1]
                .map(|i| i as u32);
            mesh.triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    mesh
}
