//! Connected parts of a mask and their properties.

use super::look::Look;
use crate::distance::{PIXEL, distances};
use trocar_camera::{DepthImage, pixel_neighbours};

/// A connected part of the closed grey mask.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// Pixels.
    pub area: usize,
    /// Grey pixels in it; the counts below are of these.
    pub grey: usize,
    pub seeds: usize,
    /// Grey pixels darker than a share of the surroundings' brightness; 0 without surroundings.
    pub dark: usize,
    /// Whether it reaches the image's rim.
    pub at_rim: bool,
    /// Largest distance to the outside (fifths of a pixel).
    pub thickness: u16,
    /// How much nearer it is to the camera than its surroundings (m), median; `None` without enough
    /// depth.
    pub nearer: Option<f64>,
}

impl Part {
    /// Length over width of a bar of this area and thickness.
    pub fn elongation(&self) -> f64 {
        let half = f64::from(self.thickness) / f64::from(PIXEL);
        self.area as f64 / (4.0 * half * half).max(1.0)
    }
}

/// Parts (4-connected) of `set`, and the part of every pixel.
pub(super) fn find_parts(set: &[bool], looks: &[Look], width: usize, height: usize) -> (Vec<Option<u32>>, Vec<Part>) {
    let rest: Vec<bool> = set.iter().map(|s| !s).collect();
    let inside = distances(&rest, width, height, false);
    let mut labels: Vec<Option<u32>> = vec![None; set.len()];
    let mut parts = Vec::new();
    let mut queue = Vec::new();
    for start in 0..set.len() {
        if !set[start] || labels[start].is_some() {
            continue;
        }
        let label = Some(parts.len() as u32);
        let mut part = Part::default();
        queue.clear();
        queue.push(start);
        labels[start] = label;
        while let Some(i) = queue.pop() {
            let (u, v, look) = (i % width, i / width, looks[i]);
            part.area += 1;
            if look.grey {
                part.grey += 1;
                part.seeds += usize::from(look.seed);
            }
            part.at_rim |= u == 0 || v == 0 || u + 1 == width || v + 1 == height;
            part.thickness = part.thickness.max(inside[i]);
            for n in pixel_neighbours(i, width, height) {
                if set[n] && labels[n].is_none() {
                    labels[n] = label;
                    queue.push(n);
                }
            }
        }
        parts.push(part);
    }
    (labels, parts)
}

/// Compares parts with their surroundings up to `reach` pixels away, in an image of `size` (width,
/// height). Walks outwards from all parts at once; each pixel is compared with the part's pixel
/// from which it was reached.
pub(super) fn compare(
    labels: &[Option<u32>],
    parts: &mut [Part],
    looks: &[Look],
    depth: Option<&DepthImage>,
    [width, height]: [usize; 2],
    reach: f64,
    dark: f64,
) {
    // Pixels next to the edge mix both sides, and a stereo camera enlarges near objects.
    let (skip, steps) = ((0.25 * reach).ceil() as usize, reach.ceil() as usize);
    let mut origin: Vec<u32> = vec![u32::MAX; labels.len()];
    let at_edge = |i: &usize| labels[*i].is_some() && pixel_neighbours(*i, width, height).any(|n| labels[n].is_none());
    let mut front: Vec<usize> = (0..labels.len()).filter(at_edge).collect();
    for i in &front {
        origin[*i] = *i as u32;
    }
    let mut differences: Vec<Vec<f32>> = vec![Vec::new(); parts.len()];
    let mut brightness = vec![(0u64, 0u64); parts.len()]; // sum and count
    for step in 1..=steps {
        let mut next = Vec::new();
        for i in front {
            for n in pixel_neighbours(i, width, height) {
                if labels[n].is_some() || origin[n] != u32::MAX {
                    continue;
                }
                origin[n] = origin[i];
                next.push(n);
                let from = origin[n] as usize;
                let Some(label) = labels[from].filter(|_| step > skip) else { continue };
                let (sum, count) = &mut brightness[label as usize];
                *sum += u64::from(looks[n].brightness);
                *count += 1;
                if let Some(depth) = depth
                    && valid(depth.depth[n])
                    && let Some(near) = nearest_around(depth, from)
                {
                    differences[label as usize].push(depth.depth[n] - near);
                }
            }
        }
        front = next;
    }
    for (part, mut differences) in parts.iter_mut().zip(differences) {
        if differences.len() >= 20 {
            let middle = differences.len() / 2;
            part.nearer = Some(f64::from(*differences.select_nth_unstable_by(middle, f32::total_cmp).1));
        }
    }
    let limits: Vec<f64> = brightness.into_iter().map(|(sum, n)| dark * sum as f64 / n.max(1) as f64).collect();
    for (label, look) in labels.iter().zip(looks) {
        if let Some(label) = label.filter(|_| look.grey) {
            parts[label as usize].dark += usize::from(f64::from(look.brightness) < limits[label as usize]);
        }
    }
}

fn valid(depth: f32) -> bool {
    depth.is_finite() && depth > 0.0
}

/// The nearest valid depth in the 5 x 5 pixels around `i`, which is the part's and not its
/// background's.
fn nearest_around(depth: &DepthImage, i: usize) -> Option<f32> {
    let (u, v) = (i % depth.width, i / depth.width);
    let mut nearest: Option<f32> = None;
    for y in v.saturating_sub(2)..(v + 3).min(depth.height) {
        for d in &depth.depth[y * depth.width..][u.saturating_sub(2)..(u + 3).min(depth.width)] {
            if valid(*d) && nearest.is_none_or(|n| *d < n) {
                nearest = Some(*d);
            }
        }
    }
    nearest
}
