//! Masks, depths and errors drawn over photographs.

use crate::colors::{self, DIVERGING, SEQUENTIAL};
use trocar_camera::{ColorImage, DepthImage, Mask};

/// Range of the map of signed errors: plus and minus this (m).
pub const ERROR_SPAN: f64 = 5e-3;

/// Draws the rim of `mask`, two pixels wide, inside the mask.
pub fn outline(picture: &mut ColorImage, mask: &Mask, color: [u8; 3]) {
    let (w, h) = (mask.width as isize, mask.height as isize);
    let inside = |x: isize, y: isize| x >= 0 && y >= 0 && x < w && y < h && mask.set[(y * w + x) as usize];
    for y in 0..h {
        for x in 0..w {
            let near = [(-2, 0), (-1, -1), (0, -2), (1, -1), (2, 0), (1, 1), (0, 2), (-1, 1)];
            if inside(x, y) && near.iter().any(|(dx, dy)| !inside(x + dx, y + dy)) {
                picture.pixels[(y * w + x) as usize] = color;
            }
        }
    }
}

/// Blends `color` over the mask, with `opacity` in [0, 1].
pub fn tint(picture: &mut ColorImage, mask: &Mask, color: [u8; 3], opacity: f64) {
    for (pixel, _) in picture.pixels.iter_mut().zip(&mask.set).filter(|(_, set)| **set) {
        *pixel = colors::mix(*pixel, color, opacity);
    }
}

/// Tints and outlines `mask` in the colour of organ `index`.
pub fn overlay(picture: &mut ColorImage, mask: &Mask, index: usize) {
    tint(picture, mask, colors::organ(index), 0.42);
    outline(picture, mask, colors::organ(index));
}

/// A darkened grey version, the background of coloured maps.
pub fn dimmed(picture: &ColorImage) -> ColorImage {
    let grey = |c: &[u8; 3]| [colors::luma(*c) / 2; 3];
    ColorImage { pixels: picture.pixels.iter().map(grey).collect(), ..*picture }
}

/// Depth in false colours over `range` (m); black without depth.
pub fn depth(depth: &DepthImage, range: (f64, f64)) -> ColorImage {
    let span = (range.1 - range.0).max(f64::MIN_POSITIVE);
    let color = |d: &f32| {
        if *d > 0.0 { colors::map(&SEQUENTIAL, (f64::from(*d) - range.0) / span) } else { [0; 3] }
    };
    ColorImage { width: depth.width, height: depth.height, pixels: depth.depth.iter().map(color).collect() }
}

/// Draws signed errors (m) where `compared` is set.
pub fn error(picture: &mut ColorImage, error: &[f32], compared: &Mask) {
    for ((pixel, e), _) in picture.pixels.iter_mut().zip(error).zip(&compared.set).filter(|(_, set)| **set) {
        *pixel = colors::map(&DIVERGING, 0.5 + 0.5 * f64::from(*e) / ERROR_SPAN);
    }
}

/// Smallest box (x0, y0, x1, y1; ends excluded) around the mask with `margin` pixels, widened to
/// the ratio `aspect` of width to height; none for an empty mask.
pub fn crop_box(mask: &Mask, margin: usize, aspect: f64) -> Option<[usize; 4]> {
    let set = || mask.set.iter().enumerate().filter(|(_, s)| **s).map(|(i, _)| (i % mask.width, i / mask.width));
    let x0 = set().map(|p| p.0).min()?.saturating_sub(margin);
    let x1 = (set().map(|p| p.0).max()? + 1 + margin).min(mask.width);
    let y0 = set().map(|p| p.1).min()?.saturating_sub(margin);
    let y1 = (set().map(|p| p.1).max()? + 1 + margin).min(mask.height);
    let (w, h) = ((x1 - x0) as f64, (y1 - y0) as f64);
    let widen = |a: usize, b: usize, size: f64, limit: usize| {
        let size = (size.round() as usize).clamp(b - a, limit);
        let a = ((a + b) / 2).saturating_sub(size / 2).min(limit - size);
        (a, a + size)
    };
    let (x0, x1) = widen(x0, x1, h * aspect, mask.width);
    let (y0, y1) = widen(y0, y1, w / aspect, mask.height);
    Some([x0, y0, x1, y1])
}

/// The part of `picture` in a box.
pub fn crop(picture: &ColorImage, [x0, y0, x1, y1]: [usize; 4]) -> ColorImage {
    let pixels = (y0..y1).flat_map(|y| picture.pixels[y * picture.width + x0..y * picture.width + x1].to_vec());
    ColorImage { width: x1 - x0, height: y1 - y0, pixels: pixels.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_is_the_rim_only() {
        let mut mask = Mask::new(20, 20);
        for y in 5..15 {
            for x in 5..15 {
                mask.set[y * 20 + x] = true;
            }
        }
        let mut picture = ColorImage::new(20, 20, [0; 3]);
        outline(&mut picture, &mask, [255; 3]);
        let at = |x: usize, y: usize| picture.pixels[y * 20 + x];
        assert_eq!((at(5, 10), at(6, 10), at(7, 10), at(4, 10)), ([255; 3], [255; 3], [0; 3], [0; 3]));
    }

    #[test]
    fn errors_are_blue_below_red_above_and_untouched_elsewhere() {
        let mut picture = ColorImage::new(3, 1, [1, 2, 3]);
        let compared = Mask { width: 3, height: 1, set: vec![true, true, false] };
        error(&mut picture, &[-0.004, 0.004, 0.004], &compared);
        assert!(picture.pixels[0][2] > picture.pixels[0][0] && picture.pixels[1][0] > picture.pixels[1][2]);
        assert_eq!(picture.pixels[2], [1, 2, 3]);
    }

    #[test]
    fn crops_stay_inside_and_hold_the_mask() {
        let mut mask = Mask::new(40, 30);
        assert_eq!(crop_box(&mask, 3, 1.0), None);
        mask.set[29 * 40 + 39] = true;
        mask.set[20 * 40 + 38] = true;
        let [x0, y0, x1, y1] = crop_box(&mask, 3, 1.0).unwrap();
        assert!(x0 <= 38 && y0 <= 20 && x1 == 40 && y1 == 30);
        assert_eq!(x1 - x0, y1 - y0);
        let part = crop(&ColorImage::new(40, 30, [7; 3]), [x0, y0, x1, y1]);
        assert_eq!(part.pixels.len(), part.width * part.height);
    }
}
