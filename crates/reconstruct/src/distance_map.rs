//! Exact Euclidean distance to a silhouette.
//!
//! Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", Theory of Computing
//! 8, 2012.

use trocar_camera::Mask;

/// Distance from each set pixel's centre to the nearest pixel that is not set; 0 outside the mask.
/// Pixels are `spacing` = (x, y) apart, and outside the image nothing is set.
pub fn distance_map(mask: &Mask, spacing: [f64; 2]) -> Vec<f64> {
    // A border of one pixel around the image is enough.
    let (width, height) = (mask.width + 2, mask.height + 2);
    let mut squared = vec![0.0; width * height];
    for v in 0..mask.height {
        for u in 0..mask.width {
            if mask.set[v * mask.width + u] {
                squared[(v + 1) * width + u + 1] = f64::INFINITY;
            }
        }
    }
    let mut line = vec![0.0; height];
    for u in 0..width {
        for v in 0..height {
            line[v] = squared[v * width + u];
        }
        for (v, d) in lower_envelope(&line, spacing[1]).into_iter().enumerate() {
            squared[v * width + u] = d;
        }
    }
    for row in squared.chunks_mut(width) {
        let d = lower_envelope(row, spacing[0]);
        row.copy_from_slice(&d);
    }
    let inner = |i: usize| squared[(i / mask.width + 1) * width + i % mask.width + 1].sqrt();
    (0..mask.set.len()).map(inner).collect()
}

/// min over j of f(j) + (step (i - j))^2 for every i: the lower envelope of parabolas.
fn lower_envelope(f: &[f64], step: f64) -> Vec<f64> {
    // The parabola at `.0` is the lowest from `.1` on.
    let mut hull: Vec<(usize, f64)> = Vec::with_capacity(f.len());
    let at = |j: usize| step * j as f64;
    for j in (0..f.len()).filter(|j| f[*j].is_finite()) {
        let mut from = f64::NEG_INFINITY;
        while let Some(&(k, start)) = hull.last() {
            let cross = ((f[j] + at(j) * at(j)) - (f[k] + at(k) * at(k))) / (2.0 * (at(j) - at(k)));
            if cross > start {
                from = cross;
                break;
            }
            hull.pop();
        }
        hull.push((j, from));
    }
    let mut lowest = 0;
    (0..f.len())
        .map(|i| {
            while lowest + 1 < hull.len() && hull[lowest + 1].1 < at(i) {
                lowest += 1;
            }
            hull.get(lowest).map_or(f64::INFINITY, |&(j, _)| f[j] + (at(i) - at(j)).powi(2))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_search_over_all_pixels() {
        let (w, h) = (23, 17);
        let mut mask = Mask::new(w, h);
        for i in 0..w * h {
            mask.set[i] = (i * 7919 + i * i * 31) % 11 != 0;
        }
        let spacing = [0.9, 1.3];
        let map = distance_map(&mask, spacing);
        for i in 0..w * h {
            let mut nearest = if mask.set[i] { f64::INFINITY } else { 0.0 };
            for y in -1..=h as i64 {
                for x in -1..=w as i64 {
                    let inside = (0..w as i64).contains(&x) && (0..h as i64).contains(&y);
                    if !inside || !mask.set[y as usize * w + x as usize] {
                        let (dx, dy) = (x - (i % w) as i64, y - (i / w) as i64);
                        nearest = nearest.min((dx as f64 * spacing[0]).hypot(dy as f64 * spacing[1]));
                    }
                }
            }
            assert!((map[i] - nearest).abs() < 1e-12, "pixel {i}");
        }
    }
}
