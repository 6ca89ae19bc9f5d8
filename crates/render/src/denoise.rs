//! Removes the noise of a path-traced picture: an edge-avoiding wavelet filter (Dammertz and
//! others, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering", 2010)
//! whose tolerance of colour is the noise of the pixel (Schied and others, "Spatiotemporal
//! Variance-Guided Filtering", 2017). It averages light without the surface's colour, over pixels
//! whose surface has the same colour, normal and place.

use rayon::prelude::*;

/// Passes of the filter: pass k takes pixels 2^k apart.
const PASSES: u32 = 4;

/// Weights of the five places of a pass in each direction.
const KERNEL: [f32; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];

/// Tolerances: of colour over its standard deviation, of the albedo, and of the distance from the
/// tangent plane over the depth.
const COLOR: f32 = 2.2;
const ALBEDO: f32 = 0.06;
const PLANE: f32 = 0.004;

/// Exponent of the cosine between normals, as a power of two.
const NORMAL_DOUBLINGS: u32 = 6;

/// Least albedo by which light is divided.
const MIN_ALBEDO: f32 = 0.02;

/// A weight is (1 - this times the difference) to the power of 16. That is nearly an exponential,
/// and it has the same bits on any machine.
const FALLOFF: f32 = 1.0 / 16.0;

/// What the paths of a pixel saw first, on average, and what they carried.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Guide {
    /// Radiance of the first and of the second half of the samples.
    pub halves: [[f32; 3]; 2],
    /// Linear colour of the surface.
    pub albedo: [f32; 3],
    /// Its normal, shorter where normals differ.
    pub normal: [f32; 3],
    /// Its place relative to the eye (m).
    pub place: [f32; 3],
}

/// A pixel of the filter.
#[derive(Clone, Copy, Debug, Default)]
struct Filtered {
    light: [f32; 3],
    /// Variance of the luminance.
    variance: f32,
}

/// Writes the filtered radiance of a picture of this width.
pub(crate) fn denoise(guides: &[Guide], width: usize, light: &mut [[f32; 3]]) {
    if guides.is_empty() {
        return;
    }
    let mut from: Vec<Filtered> = guides.par_iter().map(without_albedo).collect();
    let mut to = from.clone();
    for pass in 0..PASSES {
        let variance = smoothed(&from, width);
        let filter = Filter { guides, from: &from, variance: &variance, width, step: 1 << pass };
        to.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
            for (u, pixel) in row.iter_mut().enumerate() {
                *pixel = filter.at(u, v);
            }
        });
        std::mem::swap(&mut from, &mut to);
    }
    light.par_iter_mut().zip(&from).zip(guides).for_each(|((light, from), guide)| {
        *light = std::array::from_fn(|k| from.light[k] * guide.albedo[k].max(MIN_ALBEDO));
    });
}

/// Light over the surface's colour, with the variance of its mean by its two halves.
fn without_albedo(guide: &Guide) -> Filtered {
    let of = |half: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| half[k] / guide.albedo[k].max(MIN_ALBEDO)) };
    let [a, b] = guide.halves.map(of);
    let light = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
    Filtered { light, variance: 0.25 * (luminance(a) - luminance(b)).powi(2) }
}

fn luminance(color: [f32; 3]) -> f32 {
    0.25 * color[0] + 0.5 * color[1] + 0.25 * color[2]
}

/// The variance averaged over 3 x 3 pixels: two halves say little of one pixel.
fn smoothed(pixels: &[Filtered], width: usize) -> Vec<f32> {
    let height = pixels.len() / width;
    let mut out = vec![0.0; pixels.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (u, out) in row.iter_mut().enumerate() {
            let (mut sum, mut count) = (0.0, 0.0);
            for j in v.saturating_sub(1)..height.min(v + 2) {
                for pixel in &pixels[j * width + u.saturating_sub(1)..j * width + width.min(u + 2)] {
                    sum += pixel.variance;
                    count += 1.0;
                }
            }
            *out = sum / count;
        }
    });
    out
}

/// One pass.
struct Filter<'a> {
    guides: &'a [Guide],
    from: &'a [Filtered],
    variance: &'a [f32],
    width: usize,
    step: isize,
}

impl Filter<'_> {
    fn at(&self, u: usize, v: usize) -> Filtered {
        let centre = v * self.width + u;
        let (own, here) = (&self.guides[centre], &self.from[centre]);
        let deviation = COLOR * self.variance[centre].max(0.0).sqrt() + 1e-4;
        let depth = dot(own.place, own.place).sqrt();
        let plane = 1.0 / (PLANE * depth).max(1e-9);
        let brightness = luminance(here.light);
        let (mut light, mut variance, mut weights) = ([0.0; 3], 0.0, 0.0);
        let height = self.from.len() / self.width;
        for (dv, kv) in (-2..=2).zip(KERNEL) {
            let Some(j) = v.checked_add_signed(dv * self.step).filter(|j| *j < height) else { continue };
            for (du, ku) in (-2..=2).zip(KERNEL) {
                let Some(i) = u.checked_add_signed(du * self.step).filter(|i| *i < self.width) else { continue };
                let other = j * self.width + i;
                let (guide, there) = (&self.guides[other], &self.from[other]);
                let offset: [f32; 3] = std::array::from_fn(|k| guide.place[k] - own.place[k]);
                let colors: [f32; 3] = std::array::from_fn(|k| guide.albedo[k] - own.albedo[k]);
                let off = dot(colors, colors) / (ALBEDO * ALBEDO)
                    + dot(own.normal, offset).abs() * plane
                    + (luminance(there.light) - brightness).abs() / deviation;
                let near = 1.0 - FALLOFF * off;
                if near <= 0.0 {
                    continue;
                }
                let nothing = own.normal == [0.0; 3] && guide.normal == [0.0; 3];
                let aligned = if other == centre || nothing { 1.0 } else { dot(own.normal, guide.normal) };
                let weight = ku * kv * squared(near, 4) * squared(aligned.clamp(0.0, 1.0), NORMAL_DOUBLINGS);
                for k in 0..3 {
                    light[k] += weight * there.light[k];
                }
                variance += weight * weight * self.from[other].variance;
                weights += weight;
            }
        }
        Filtered { light: light.map(|sum| sum / weights), variance: variance / (weights * weights) }
    }
}

/// `x` to the power of 2^`times`.
fn squared(x: f32, times: u32) -> f32 {
    (0..times).fold(x, |x, _| x * x)
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
