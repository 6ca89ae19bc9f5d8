//! Fills unknown pixels from their surroundings by means at coarser and coarser scales (pull-push:
//! S. J. Gortler and others, "The Lumigraph", 1996, section 3.4).

/// An image with known and unknown pixels, row by row.
#[derive(Clone)]
pub(super) struct Sparse<const N: usize> {
    pub width: usize,
    pub height: usize,
    pub values: Vec<[f64; N]>,
    pub known: Vec<bool>,
}

/// The values of all pixels; 0 if no pixel is known.
pub(super) fn fill<const N: usize>(image: &Sparse<N>) -> Vec<[f64; N]> {
    let (w, h) = (image.width, image.height);
    if image.known.iter().all(|k| *k) || w.max(h) <= 1 {
        return image.values.clone();
    }
    let (half_w, half_h) = (w.div_ceil(2), h.div_ceil(2));
    let mut half = Sparse {
        width: half_w,
        height: half_h,
        values: vec![[0.0; N]; half_w * half_h],
        known: vec![false; half_w * half_h],
    };
    for i in 0..half.values.len() {
        let (u, v) = (2 * (i % half_w), 2 * (i / half_w));
        let block = [(u, v), (u + 1, v), (u, v + 1), (u + 1, v + 1)];
        let known = block.into_iter().filter(|(x, y)| *x < w && *y < h).map(|(x, y)| y * w + x);
        let known: Vec<usize> = known.filter(|j| image.known[*j]).collect();
        if !known.is_empty() {
            half.known[i] = true;
            half.values[i] =
                std::array::from_fn(|c| known.iter().map(|j| image.values[*j][c]).sum::<f64>() / known.len() as f64);
        }
    }
    let coarse = fill(&half);
    let at = |x: isize, y: isize| {
        let x = x.clamp(0, half_w as isize - 1) as usize;
        let y = y.clamp(0, half_h as isize - 1) as usize;
        coarse[y * half_w + x]
    };
    let pixel = |i: usize| {
        if image.known[i] {
            return image.values[i];
        }
        let (u, v) = ((i % w) as isize, (i / w) as isize);
        let (x, y) = (u / 2, v / 2);
        let (dx, dy) = (if u % 2 == 0 { -1 } else { 1 }, if v % 2 == 0 { -1 } else { 1 });
        let (a, b, c, d) = (at(x, y), at(x + dx, y), at(x, y + dy), at(x + dx, y + dy));
        std::array::from_fn(|k| (9.0 * a[k] + 3.0 * (b[k] + c[k]) + d[k]) / 16.0)
    };
    (0..w * h).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_a_slope_is_filled_from_its_rim() {
        let (width, height) = (61, 47);
        let value = |i: usize| [(i % width) as f64, 5.0];
        let hole = |i: usize| (20..40).contains(&(i % width)) && (10..30).contains(&(i / width));
        let image = Sparse {
            width,
            height,
            values: (0..width * height).map(|i| if hole(i) { [1e9; 2] } else { value(i) }).collect(),
            known: (0..width * height).map(|i| !hole(i)).collect(),
        };
        let filled = fill(&image);
        for i in 0..filled.len() {
            let [x, c] = filled[i];
            assert!((c - 5.0).abs() < 1e-9, "a constant is kept");
            assert!(if hole(i) { (x - value(i)[0]).abs() < 8.0 } else { x == value(i)[0] }, "{i}: {x}");
        }
        let nothing = Sparse { width: 3, height: 2, values: vec![[0.0]; 6], known: vec![false; 6] };
        assert_eq!(fill(&nothing), vec![[0.0]; 6]);
    }
}
