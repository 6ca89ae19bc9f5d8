//! Distances in masks, and dilation, erosion and closing by distance.
//!
//! Distances are chamfer distances with weights 5 and 7 (Borgefors 1986, "Distance transformations
//! in digital images"): at most 8% too long and 1% too short. They take two passes for every
//! radius.

/// A step of one pixel, in the unit of [`distances`].
pub(crate) const PIXEL: u16 = 5;
const DIAGONAL: u16 = 7;
const MAX_DISTANCE: u16 = u16::MAX - 2 * DIAGONAL;

/// Distance of every pixel to the nearest one of `set`, in fifths of a pixel; saturates at about
/// 13,000 pixels. With `rim`, the outside of the image counts as set.
pub(crate) fn distances(set: &[bool], width: usize, height: usize, rim: bool) -> Vec<u16> {
    let mut d: Vec<u16> = set.iter().map(|s| if *s { 0 } else { MAX_DISTANCE }).collect();
    if width == 0 || height == 0 {
        return d;
    }
    if rim {
        for v in 0..height {
            for u in if v == 0 || v + 1 == height { 0..width } else { 0..1 } {
                d[v * width + u] = d[v * width + u].min(PIXEL);
            }
            let last = v * width + width - 1;
            d[last] = d[last].min(PIXEL);
        }
    }
    let rows: Vec<usize> = (0..height).collect();
    sweep(&mut d, width, &rows);
    let rows: Vec<usize> = rows.into_iter().rev().collect();
    sweep(&mut d, width, &rows);
    d
}

/// Propagates distances along `rows`, each from the row before it in the list, and along each row
/// both ways. It works row by row so that the compiler can vectorise.
fn sweep(d: &mut [u16], width: usize, rows: &[usize]) {
    let mut before = vec![MAX_DISTANCE; width + 2]; // with a pixel more on both sides
    for &v in rows {
        let row = &mut d[v * width..(v + 1) * width];
        for (x, near) in row.iter_mut().zip(before.windows(3)) {
            *x = (*x).min(near[1] + PIXEL).min(near[0].min(near[2]) + DIAGONAL);
        }
        let mut last = MAX_DISTANCE;
        for x in row.iter_mut() {
            last = (last + PIXEL).min(*x);
            *x = last;
        }
        last = MAX_DISTANCE;
        for x in row.iter_mut().rev() {
            last = (last + PIXEL).min(*x);
            *x = last;
        }
        before[1..=width].copy_from_slice(row);
    }
}

/// Pixels of `set` and those within `radius` pixels of it.
pub(crate) fn grow(set: &[bool], width: usize, height: usize, radius: f64) -> Vec<bool> {
    let reach = reach(radius);
    distances(set, width, height, false).into_iter().map(|d| d <= reach).collect()
}

/// Morphological closing: closes gaps narrower than twice `radius`. The image's rim is not a gap.
pub(crate) fn close(set: &[bool], width: usize, height: usize, radius: f64) -> Vec<bool> {
    let reach = reach(radius);
    let gaps: Vec<bool> = distances(set, width, height, false).into_iter().map(|d| d > reach).collect();
    distances(&gaps, width, height, false).into_iter().map(|d| d > reach).collect()
}

/// A radius in the unit of [`distances`].
fn reach(radius: f64) -> u16 {
    (radius * f64::from(PIXEL)).clamp(0.0, f64::from(MAX_DISTANCE - 1)) as u16
}

/// The pixel of `set` farthest from all other pixels, the first of several; the outside of the
/// image counts as other pixels.
pub(crate) fn innermost(set: &[bool], width: usize, height: usize) -> Option<usize> {
    let rest: Vec<bool> = set.iter().map(|s| !s).collect();
    let mut best: Option<(u16, usize)> = None;
    for (i, d) in distances(&rest, width, height, true).into_iter().enumerate() {
        if set[i] && best.is_none_or(|(b, _)| d > b) {
            best = Some((d, i));
        }
    }
    best.map(|(_, i)| i)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_nearly_euclidean() {
        let (width, height) = (41, 31);
        let mut set = vec![false; width * height];
        set[12 * width + 9] = true;
        for (i, d) in distances(&set, width, height, false).into_iter().enumerate() {
            let exact = ((i % width) as f64 - 9.0).hypot((i / width) as f64 - 12.0);
            let ratio = f64::from(d) / 5.0 / exact.max(1e-9);
            assert!(exact == 0.0 && d == 0 || (0.985..1.08).contains(&ratio), "{d} fifths for {exact} at {i}");
        }
        assert!(distances(&[false; 6], 3, 2, false).into_iter().all(|d| d >= MAX_DISTANCE));
        assert!(distances(&[], 0, 0, true).is_empty());
    }

    #[test]
    fn gaps_close_and_the_middle_is_found() {
        let width = 30;
        let bar = |u: usize| (0..30).contains(&u) && !(12..15).contains(&u);
        let set: Vec<bool> = (0..width * 9).map(|i| (3..6).contains(&(i / width)) && bar(i % width)).collect();
        let closed = close(&set, width, 9, 3.0);
        assert!(closed[4 * width + 13] && !closed[8 * width + 13]);
        assert_eq!(grow(&set, width, 9, 1.0)[2 * width..2 * width + 3], [true; 3]);
        let disc: Vec<bool> =
            (0..width * 30).map(|i| (i % width).abs_diff(17).pow(2) + (i / width).abs_diff(11).pow(2) < 50).collect();
        assert_eq!(innermost(&disc, width, 30), Some(11 * width + 17));
        assert_eq!(innermost(&[true; 25], 5, 5), Some(12));
        assert_eq!(innermost(&[false; 4], 2, 2), None);
    }
}
