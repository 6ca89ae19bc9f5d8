//! The surgical field below the organs: a plane at their lowest points with their imprints, in the
//! colours of the recorded picture.
//!
//! A specimen does not record the position of the field. It is placed at the median of the organs'
//! lowest points and sinks where an organ reaches deeper. The brightness of the picture gives it a
//! relief of half a millimetre; without relief, wet tissue looks like glass. Where organs covered
//! the field, colours are interpolated from their surroundings.

use glam::{DVec2, DVec3};
use trocar_camera::{Camera, ColorImage};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, Film, RayGenerator, RenderSettings, Stage, render, srgb};

/// Maximum number of cells along a side.
const MAX_CELLS: f64 = 360.0;
/// Maximum extent beyond the organs (m).
const MAX_EXTENT: f64 = 0.16;
/// Gap below an organ (m).
const GAP: f64 = 0.4e-3;
/// Height of the relief (m).
const RELIEF: f64 = 0.6e-3;
/// Colour without a recorded picture.
const DEFAULT_COLOR: [u8; 3] = [150, 66, 58];
/// Width of the border around organs that their shadow colours (px).
const SHADOW_BORDER: usize = 5;

/// The field below organs in their recorded pose, with up along z.
pub(crate) struct Field {
    pub mesh: TriMesh,
    /// Corners of its rectangle in the plane (m).
    pub low: DVec2,
    pub high: DVec2,
    /// Height of the plane (m).
    pub height: f64,
}

/// The recorded picture with the camera that took it and the pose of the camera.
pub(crate) struct Recorded<'a> {
    pub picture: &'a ColorImage,
    pub camera: &'a Camera,
    pub pose: Pose,
}

impl Field {
    pub fn under(surfaces: &[&TriMesh], recorded: Option<&Recorded<'_>>) -> trocar_render::Result<Self> {
        let mut feet: Vec<f64> = surfaces.iter().filter_map(|s| s.bounds()).map(|(low, _)| low.z).collect();
        feet.sort_by(f64::total_cmp);
        let height = feet.get(feet.len() / 2).copied().unwrap_or(0.0) + GAP;
        let bounds = surfaces.iter().filter_map(|s| s.bounds()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let (low, high) = bounds.unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let (low, high) = rectangle(low.truncate(), high.truncate(), height, recorded);
        let mut organs = Stage::new();
        for surface in surfaces {
            organs.add_mesh(surface, 1, &Appearance::matte([128; 3]))?;
        }
        let texture = recorded.map(|r| Texture::of(r, &mut organs));
        let cell = ((high - low).max_element() / MAX_CELLS).max(5e-4);
        let [nx, ny] = ((high - low) / cell).to_array().map(|n| (n.ceil() as usize).clamp(2, MAX_CELLS as usize));
        let mut mesh = TriMesh::default();
        for j in 0..=ny {
            for i in 0..=nx {
                let share = DVec2::new(i as f64 / nx as f64, j as f64 / ny as f64);
                let at = low + share * (high - low);
                let rim = i == 0 || j == 0 || i == nx || j == ny;
                let color = texture.as_ref().map_or(DEFAULT_COLOR, |t| t.at(at.extend(height)));
                let mut z = height + RELIEF * (brightness(color) - 0.3).clamp(-1.0, 1.0);
                let below = at.extend(height - 0.2);
                if let Some(under) = organs.cast(below.as_vec3(), glam::Vec3::Z) {
                    z = z.min(below.z + f64::from(under.t) - GAP);
                }
                mesh.vertices.push(at.extend(if rim { height - 0.004 } else { z }));
                mesh.colors.push(color);
            }
        }
        for j in 0..ny {
            for i in 0..nx {
                let a = (j * (nx + 1) + i) as u32;
                let c = a + nx as u32 + 1;
                mesh.triangles.extend([[a, a + 1, c], [a + 1, c + 1, c]]);
            }
        }
        Ok(Self { mesh, low, high, height })
    }
}

fn brightness([r, g, b]: [u8; 3]) -> f64 {
    (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) / 255.0
}

/// The part of the plane that the recording camera saw, limited to [`MAX_EXTENT`] beyond the
/// organs. It exceeds the organs by a margin in any case.
fn rectangle(low: DVec2, high: DVec2, height: f64, recorded: Option<&Recorded<'_>>) -> (DVec2, DVec2) {
    let least = 0.25 * (high - low).max_element().max(0.02);
    let (mut seen_low, mut seen_high) = (low - least, high + least);
    if let Some(Recorded { camera, pose, .. }) = recorded {
        let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
        for (u, v) in [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)] {
            let ray = pose.rotation * camera.ray(u, v);
            let t = (height - pose.translation.z) / ray.z;
            if t.is_finite() && t > 0.0 {
                let at = (pose.translation + t * ray).truncate();
                (seen_low, seen_high) = (seen_low.min(at), seen_high.max(at));
            }
        }
    }
    (seen_low.max(low - MAX_EXTENT), seen_high.min(high + MAX_EXTENT))
}

/// The recorded picture without the organs.
struct Texture<'a> {
    picture: ColorImage,
    camera: &'a Camera,
    from_world: Pose,
}

impl<'a> Texture<'a> {
    fn of(recorded: &Recorded<'a>, organs: &mut Stage) -> Self {
        let Recorded { picture, camera, pose } = *recorded;
        let mut picture = picture.clone();
        if (picture.width, picture.height) == (camera.width, camera.height) {
            let settings = RenderSettings::Preview { shadows: false };
            let seen = render(organs, &RayGenerator::new(*camera), &pose, &settings, &Film::default());
            let mut hidden: Vec<bool> = seen.labels.iter().map(|l| *l != 0).collect();
            for _ in 0..SHADOW_BORDER {
                hidden = dilated(&hidden, picture.width, picture.height);
            }
            fill(&mut picture, &hidden);
        }
        Self { picture, camera, from_world: pose.inverse() }
    }

    /// Colour at a world position. Beyond its border the picture is mirrored.
    fn at(&self, p: DVec3) -> [u8; 3] {
        let Some(pixel) = self.camera.project(self.from_world.transform(p)) else { return DEFAULT_COLOR };
        let (width, height) = (self.picture.width, self.picture.height);
        let mirror = |x: f64, n: usize| {
            let most = (n - 1) as f64;
            let x = if x.is_finite() { x.rem_euclid(2.0 * most.max(1.0)) } else { 0.0 };
            if x > most { (2.0 * most - x).max(0.0) } else { x }
        };
        let (x, y) = (mirror(pixel.x, width), mirror(pixel.y, height));
        let (i, j) = (x as usize, y as usize);
        let (a, b) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let at =
            |i: usize, j: usize| srgb::to_linear(self.picture.pixels[j.min(height - 1) * width + i.min(width - 1)]);
        let corners = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        srgb::from_linear([0, 1, 2].map(|k| corners.iter().zip(weights).map(|(c, w)| w * c[k]).sum()))
    }
}

fn dilated(set: &[bool], width: usize, height: usize) -> Vec<bool> {
    (0..set.len()).map(|i| set[i] || trocar_camera::pixel_neighbours(i, width, height).any(|n| set[n])).collect()
}

/// Fills hidden pixels: halves the picture until no pixel is missing, then interpolates back (Burt
/// 1988, "Moment images, polynomial fit filters, and the problem of surface interpolation").
fn fill(picture: &mut ColorImage, hidden: &[bool]) {
    struct Level {
        width: usize,
        height: usize,
        /// Colour times weight, and weight.
        values: Vec<[f32; 4]>,
    }
    let first = picture.pixels.iter().zip(hidden).map(|(p, hidden)| {
        let [r, g, b] = p.map(f32::from);
        if *hidden { [0.0; 4] } else { [r, g, b, 1.0] }
    });
    let mut levels = vec![Level { width: picture.width, height: picture.height, values: first.collect() }];
    while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
        let (width, height) = (last.width.div_ceil(2), last.height.div_ceil(2));
        let mut values = vec![[0.0_f32; 4]; width * height];
        for (i, value) in last.values.iter().enumerate() {
            let (x, y) = (i % last.width / 2, i / last.width / 2);
            for k in 0..4 {
                values[y * width + x][k] += value[k];
            }
        }
        for value in &mut values {
            let weight = value[3];
            if weight > 1.0 {
                *value = value.map(|v| v / weight);
            }
        }
        levels.push(Level { width, height, values });
    }
    for fine in (0..levels.len() - 1).rev() {
        let (below, above) = levels.split_at_mut(fine + 1);
        let (level, coarse) = (&mut below[fine], &above[0]);
        for i in 0..level.values.len() {
            let missing = 1.0 - level.values[i][3].min(1.0);
            if missing <= 0.0 {
                continue;
            }
            // Bilinear interpolation of the coarse level.
            let (x, y) = ((i % level.width) as f32 * 0.5 - 0.25, (i / level.width) as f32 * 0.5 - 0.25);
            let (x, y) = (x.max(0.0), y.max(0.0));
            let (cx, cy) = (x as usize, y as usize);
            let (a, b) = (x - cx as f32, y - cy as f32);
            let at = |x: usize, y: usize| {
                let v = coarse.values[y.min(coarse.height - 1) * coarse.width + x.min(coarse.width - 1)];
                v.map(|c| c / v[3].max(1e-6))
            };
            let corners = [at(cx, cy), at(cx + 1, cy), at(cx, cy + 1), at(cx + 1, cy + 1)];
            let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
            for k in 0..4 {
                let from: f32 = corners.iter().zip(weights).map(|(c, w)| w * c[k]).sum();
                level.values[i][k] += missing * from;
            }
        }
    }
    for ((pixel, hidden), value) in picture.pixels.iter_mut().zip(hidden).zip(&levels[0].values) {
        if *hidden {
            *pixel = [0, 1, 2].map(|k| value[k].round().clamp(0.0, 255.0) as u8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_pixels_get_the_colours_around_them() {
        let mut picture = ColorImage::new(40, 30, [0; 3]);
        let hidden: Vec<bool> =
            (0..1200).map(|i| (10..25).contains(&(i % 40)) && (8..20).contains(&(i / 40))).collect();
        for (i, p) in picture.pixels.iter_mut().enumerate() {
            *p = if hidden[i] { [0, 255, 0] } else { [(4 * (i % 40)) as u8, 20, 90] };
        }
        let before = picture.clone();
        fill(&mut picture, &hidden);
        for (i, p) in picture.pixels.iter().enumerate() {
            if hidden[i] {
                assert!((36..=104).contains(&p[0]) && p[1].abs_diff(20) <= 1 && p[2].abs_diff(90) <= 1, "{i}: {p:?}");
            } else {
                assert_eq!(*p, before.pixels[i]);
            }
        }
    }
}
