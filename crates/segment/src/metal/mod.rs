//! Finds instruments by their appearance: steel is grey, tissue is not. No weights, no prompts.
//!
//! 1. Grey pixels have little chroma for their brightness. The clearest of them, neutral or bluish,
//!    are seeds.
//! 2. Single noisy pixels are removed, narrow gaps (reflections of tissue on the shaft) are closed,
//!    and connected parts are formed.
//! 3. A part is kept if two of these hold: it reaches the image's rim, it is long, a good share of
//!    it is darker than its surroundings, it is nearer to the camera than its surroundings (where
//!    there is depth; being farther counts against it). Away from the rim darkness is required: wet
//!    highlights on tissue are grey, long and on ridges too, but never dark.
//! 4. Kept parts lose their very thick regions (drapes, trays), their small holes are filled, and
//!    they grow by a margin.
//!
//! Missed: a bright jaw that shows without its shaft, and blades thinner than about 3 pixels.
//! Wrongly included: anything grey that reaches the rim and is not very thick, such as gloves and
//! sutures.
//!
//! Lengths are shares of the image's height, so that one set of parameters serves every camera.

mod look;
mod parts;

use crate::distance::{PIXEL, close, distances, grow};
use crate::{Error, Picture, Result, Segmenter, Target};
use look::{Look, without_speckle};
use parts::{Part, compare, find_parts};
use trocar_camera::{ColorImage, Mask, pixel_neighbours};

/// Parameters of metal. Colours are sRGB in [0, 255]; lengths are shares of the image's height and
/// areas shares of its pixels. The default serves all recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct MetalParameters {
    /// Largest chroma (largest minus smallest channel) of a grey pixel: `grey_chroma +
    /// grey_saturation` x brightness (largest channel).
    pub grey_chroma: f64,
    /// See `grey_chroma`.
    pub grey_saturation: f64,
    /// The same for seeds; a part needs some.
    pub seed_chroma: f64,
    /// See `seed_chroma`.
    pub seed_saturation: f64,
    /// Largest warmth of a seed, beside half its chroma bound: how far its red is above the mean of
    /// green and blue, or its blue below that of red and green. Shadows, pale tissue, fat and bile
    /// are warm, steel is not.
    pub seed_warmth: f64,
    /// Least brightness (largest channel) of a seed: dark pixels are all grey.
    pub seed_brightness: u8,
    /// Least brightness (largest channel) of a grey pixel: around an endoscope's round picture
    /// everything is black.
    pub black: u8,
    /// Least share of seeds among a part's grey pixels.
    pub seed_share: f64,
    /// Pixels below this share of their surroundings' brightness (mean largest channel) are dark.
    pub dark: f64,
    /// Share of dark pixels from which a part counts as dark.
    pub dark_share: f64,
    /// Half the width of the gaps that are closed.
    pub closing: f64,
    /// Least area of a part.
    pub smallest: f64,
    /// Length over width from which a part counts as long.
    pub elongation: f64,
    /// Half the thickness above which parts are cut.
    pub half_thickness: f64,
    /// Width of the surroundings that a part is compared with.
    pub surroundings: f64,
    /// A part counts as near if it is nearer than its surroundings by this (m); being farther by
    /// this counts against it.
    pub nearer: f64,
    /// Largest area of a hole that is filled.
    pub hole: f64,
    /// The mask grows by this, so that no mixed rim stays outside it.
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

/// Finds all metal instruments in a picture. The target is ignored.
///
/// ```
/// use trocar_camera::ColorImage;
/// use trocar_segment::{MetalDetector, Picture, Segmenter, Target};
///
/// let tissue = ColorImage::new(64, 48, [170, 60, 50]);
/// let picture = Picture { color: &tissue, depth: None, name: "frame 0" };
/// let mask = MetalDetector::default().segment(&picture, &Target::default())?;
/// assert_eq!(mask.count(), 0);
/// # Ok::<(), trocar_segment::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct MetalDetector {
    /// Its parameters.
    pub parameters: MetalParameters,
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
                return Err(Error::Setting(format!("{name} is {value}; it must be in [0, 1]")));
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
                return Err(Error::Setting(format!("{name} is {value}; it must be in [0, 255]")));
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

/// Removes all discs of `radius` from the set.
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

/// Fills enclosed areas of at most `largest` pixels; areas at the rim are not enclosed.
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
