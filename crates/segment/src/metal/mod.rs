//! Instruments by their looks: steel is grey, tissue is not. No weights, no prompts.
//!
//! 1. Grey pixels: little chroma for their brightness; the clearest of them, neutral or bluish, are
//!    seeds.
//! 2. Single pixels of noise go, narrow gaps (reflections of tissue on the shaft) close, and
//!    connected parts are formed.
//! 3. A part stays if two things speak for it: it reaches the image's rim, is long, is darker than
//!    its surroundings in good part, or stands nearer to the camera than they (where there is
//!    depth; farther speaks against it). Inside the picture darkness is a must: wet highlights on
//!    tissue are grey, long and on ridges too, but never dark.
//! 4. What stays loses its very thick parts (drapes, trays), has its small holes filled and grows
//!    by a margin.
//!
//! What this misses: a bright jaw that shows without its shaft, and blades thinner than about 3
//! pixels. What it takes too: anything grey that reaches the rim and is not very thick, such as
//! gloves and sutures.
//!
//! Lengths are shares of the image's height, so that one set of parameters serves every camera.

mod parts;

use crate::distance::{PIXEL, close, distances, grow};
use crate::{Error, Picture, Result, Segmenter, Target};
use parts::{Part, compare, find_parts};
use trocar_camera::{ColorImage, Mask, pixel_neighbours};

/// What counts as metal. Colours are sRGB, 0 to 255; lengths are shares of the image's height and
/// areas shares of its pixels. The default is for all recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct MetalParameters {
    /// A grey pixel's chroma (largest minus smallest channel) is at most `grey_chroma +
    /// grey_saturation` x brightness (largest channel).
    pub grey_chroma: f64,
    /// See `grey_chroma`.
    pub grey_saturation: f64,
    /// The same for seeds, of which a part needs some.
    pub seed_chroma: f64,
    /// See `seed_chroma`.
    pub seed_saturation: f64,
    /// A seed's red is above the mean of green and blue, and its blue below that of red and green,
    /// by at most this and half its chroma bound: shadows, pale tissue, fat and bile are warm,
    /// steel is not.
    pub seed_warmth: f64,
    /// Darker pixels (largest channel) are no seeds: in the dark everything is grey.
    pub seed_brightness: u8,
    /// Darker pixels (largest channel) are nothing: the black around an endoscope's round picture.
    pub black: u8,
    /// Share of seeds among a part's grey pixels, at least.
    pub seed_share: f64,
    /// Pixels below this share of their surroundings' brightness (mean largest channel) are dark.
    pub dark: f64,
    /// Share of dark pixels that speaks for a part.
    pub dark_share: f64,
    /// Gaps up to twice this close.
    pub closing: f64,
    /// Smaller parts are dropped (area).
    pub smallest: f64,
    /// Length over width from which a part is long.
    pub elongation: f64,
    /// Parts are cut where they are thicker than twice this.
    pub half_thickness: f64,
    /// Surroundings that are compared reach this far.
    pub surroundings: f64,
    /// A part stands out if it is nearer than its surroundings by this [m]; the same farther away
    /// speaks against it.
    pub nearer: f64,
    /// Smaller holes are filled (area).
    pub hole: f64,
    /// The mask grows by this, so that no mixed rim stays.
    pub margin: f64,
}

impl Default for MetalParameters {
    fn default() -> Self {
        Self {
            grey_chroma: 12.0,
            grey_saturation: 0.20,
            seed_chroma: 8.0,
            seed_saturation: 0.10,
            seed_warmth: 4.0,
            seed_brightness: 24,
            black: 8,
            seed_share: 0.15,
            dark: 0.85,
            dark_share: 0.3,
            closing: 0.010,
            smallest: 0.0002,
            elongation: 3.0,
            half_thickness: 0.12,
            surroundings: 0.03,
            nearer: 0.004,
            hole: 0.001,
            margin: 0.0075,
        }
    }
}

/// Finds all metal instruments in a picture; the target only gives the name.
#[derive(Clone, Debug, Default)]
pub struct MetalDetector {
    /// What counts as metal.
    pub parameters: MetalParameters,
}

/// What a pixel is by its colour alone.
#[derive(Clone, Copy, Debug, Default)]
struct Look {
    grey: bool,
    seed: bool,
    /// Largest channel.
    brightness: u8,
}

impl Segmenter for MetalDetector {
    fn segment(&self, picture: &Picture<'_>, _target: &Target) -> Result<Mask> {
        picture.check()?;
        let p = &self.parameters;
        p.check()?;
        let (width, height) = (picture.color.width, picture.color.height);
        let px = |share: f64| share * height as f64;

        let looks = p.looks(picture.color);
        let grey = without_speckle(&looks, width, height);
        let closed = close(&grey, width, height, px(p.closing));
        let (labels, mut parts) = find_parts(&closed, &looks, width, height);
        compare(&labels, &mut parts, &looks, picture.matching_depth(), [width, height], px(p.surroundings), p.dark);
        let kept: Vec<bool> = parts.iter().map(|part| self.is_metal(part, width * height)).collect();
        if !kept.contains(&true) {
            return Ok(Mask::new(width, height));
        }
        let mut set: Vec<bool> = labels.iter().map(|label| label.is_some_and(|l| kept[l as usize])).collect();
        let thickest = parts.iter().zip(&kept).filter(|(_, k)| **k).map(|(part, _)| part.thickness).max();
        if thickest.is_some_and(|t| f64::from(t) > px(p.half_thickness) * f64::from(PIXEL)) {
            cut_thick(&mut set, width, height, px(p.half_thickness));
        }
        let mut set = grow(&set, width, height, px(p.margin));
        fill_holes(&mut set, width, height, (p.hole * (width * height) as f64) as usize);
        Ok(Mask { width, height, set })
    }

    fn describe(&self) -> String {
        "metal instruments by appearance (no weights)".into()
    }
}

impl MetalDetector {
    fn is_metal(&self, part: &Part, pixels: usize) -> bool {
        let p = &self.parameters;
        let share = |count: usize| count as f64 / part.grey.max(1) as f64;
        if (part.area as f64) < p.smallest * pixels as f64 || share(part.seeds) < p.seed_share {
            return false;
        }
        let depth = match part.nearer {
            Some(by) if by > p.nearer => 1,
            Some(by) if by < -p.nearer => -1,
            _ => 0,
        };
        let long = part.elongation() >= p.elongation;
        let dark = share(part.dark) >= p.dark_share;
        (dark || part.at_rim) && depth + i32::from(part.at_rim) + i32::from(long) + i32::from(dark) >= 2
    }
}

impl MetalParameters {
    fn check(&self) -> Result<()> {
        let shares = [
            ("grey_saturation", self.grey_saturation),
            ("seed_saturation", self.seed_saturation),
            ("seed_share", self.seed_share),
            ("dark_share", self.dark_share),
            ("dark", self.dark),
            ("closing", self.closing),
            ("smallest", self.smallest),
            ("half_thickness", self.half_thickness),
            ("surroundings", self.surroundings),
            ("hole", self.hole),
            ("margin", self.margin),
        ];
        for (name, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                return Err(Error::Setting(format!("{name} is {value}; a share from 0 to 1")));
            }
        }
        let others = [
            ("grey_chroma", self.grey_chroma),
            ("seed_chroma", self.seed_chroma),
            ("seed_warmth", self.seed_warmth),
            ("elongation", self.elongation),
            ("nearer", self.nearer),
        ];
        for (name, value) in others {
            if !(0.0..=255.0).contains(&value) {
                return Err(Error::Setting(format!("{name} is {value}; 0 to 255")));
            }
        }
        Ok(())
    }

    fn looks(&self, color: &ColorImage) -> Vec<Look> {
        let bounds =
            |base: f64, slope: f64| -> Vec<i16> { (0..256).map(|m| (base + slope * f64::from(m)) as i16).collect() };
        let grey = bounds(self.grey_chroma, self.grey_saturation);
        let seed = bounds(self.seed_chroma, self.seed_saturation);
        let warmth = self.seed_warmth as i16;
        let look = |&[r, g, b]: &[u8; 3]| {
            let (most, least) = (r.max(g).max(b), r.min(g).min(b));
            let chroma = i16::from(most - least);
            let bound = seed[usize::from(most)];
            let is_grey = most >= self.black && chroma <= grey[usize::from(most)];
            let (r, g, b) = (i16::from(r), i16::from(g), i16::from(b));
            let warm = (r - (g + b) / 2).max((r + g) / 2 - b);
            Look {
                grey: is_grey,
                seed: is_grey && most >= self.seed_brightness && chroma <= bound && warm <= warmth + bound / 2,
                brightness: most,
            }
        };
        color.pixels.iter().map(look).collect()
    }
}

/// Grey where most of the 3 x 3 pixels around are; the image goes on beyond its rim as it ends
/// there.
fn without_speckle(looks: &[Look], width: usize, height: usize) -> Vec<bool> {
    let mut rows = vec![0u8; width * height];
    for (row, out) in looks.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for u in 0..width {
            let (left, right) = (u.saturating_sub(1), (u + 1).min(width - 1));
            out[u] = u8::from(row[left].grey) + u8::from(row[u].grey) + u8::from(row[right].grey);
        }
    }
    let mut set = vec![false; width * height];
    for v in 0..height {
        let (above, below) = (v.saturating_sub(1) * width, (v + 1).min(height - 1) * width);
        for u in 0..width {
            set[v * width + u] = rows[above + u] + rows[v * width + u] + rows[below + u] >= 5;
        }
    }
    set
}

/// Takes away what a disc of `radius` fits into.
fn cut_thick(set: &mut [bool], width: usize, height: usize, radius: f64) {
    let rest: Vec<bool> = set.iter().map(|s| !s).collect();
    let limit = radius * f64::from(PIXEL);
    let core: Vec<bool> = distances(&rest, width, height, false)
        .into_iter()
        .zip(&*set)
        .map(|(d, s)| *s && f64::from(d) > limit)
        .collect();
    if core.contains(&true) {
        for (s, thick) in set.iter_mut().zip(grow(&core, width, height, radius)) {
            *s &= !thick;
        }
    }
}

/// Sets enclosed areas of at most `largest` pixels; what touches the rim is not enclosed.
fn fill_holes(set: &mut [bool], width: usize, height: usize, largest: usize) {
    let mut seen = set.to_vec();
    let mut hole = Vec::new();
    for start in 0..set.len() {
        if seen[start] {
            continue;
        }
        hole.clear();
        hole.push(start);
        seen[start] = true;
        let mut enclosed = true;
        let mut next = 0;
        while let Some(&i) = hole.get(next) {
            next += 1;
            let (u, v) = (i % width, i / width);
            enclosed &= u > 0 && v > 0 && u + 1 < width && v + 1 < height;
            for n in pixel_neighbours(i, width, height) {
                if !seen[n] {
                    seen[n] = true;
                    hole.push(n);
                }
            }
        }
        if enclosed && hole.len() <= largest {
            hole.iter().for_each(|i| set[*i] = true);
        }
    }
}

#[cfg(test)]
mod tests;
