//! Fills missing depth inside a mask by Laplace diffusion confined to the mask (paper section III).

use trocar_camera::Mask;

/// Residual of every equation at which iterations stop (m).
const TOLERANCE: f64 = 1e-9;

/// Replaces the values of `depth` (m) that are 0 inside `mask` by the harmonic extension of the
/// others: each filled pixel is the mean of its neighbours in the mask, which is the natural
/// boundary condition at the mask's edge. Solved by conjugate gradients. Returns the number of
/// filled pixels; `None` when a piece of the mask has no measured pixel.
pub fn fill(depth: &mut [f64], mask: &Mask) -> Option<usize> {
    let width = mask.width;
    let mut number = vec![usize::MAX; mask.set.len()];
    let mut unknowns = Vec::new();
    for i in 0..mask.set.len() {
        if mask.set[i] && depth[i] == 0.0 {
            number[i] = unknowns.len();
            unknowns.push(i);
        }
    }
    let neighbours = |i: usize| {
        let (u, v) = (i % width, i / width);
        [
            (u > 0).then(|| i - 1),
            (u + 1 < width).then_some(i + 1),
            (v > 0).then(|| i - width),
            (v + 1 < mask.height).then_some(i + width),
        ]
        .into_iter()
        .flatten()
        .filter(|&j| mask.set[j])
        .collect::<Vec<_>>()
    };
    let around: Vec<Vec<usize>> = unknowns.iter().map(|&i| neighbours(i)).collect();
    // The initial values are the nearest measured ones, breadth first. A pixel that is never
    // reached belongs to a piece without measurements.
    let mut ring: Vec<usize> = (0..unknowns.len()).collect();
    while !ring.is_empty() {
        let reached: Vec<(usize, f64)> = ring
            .iter()
            .filter_map(|&k| {
                let known: Vec<f64> = around[k].iter().map(|&j| depth[j]).filter(|z| *z != 0.0).collect();
                (!known.is_empty()).then(|| (k, known.iter().sum::<f64>() / known.len() as f64))
            })
            .collect();
        if reached.is_empty() {
            return None;
        }
        for &(k, z) in &reached {
            depth[unknowns[k]] = z;
        }
        ring.retain(|&k| depth[unknowns[k]] == 0.0);
    }
    // A x = b with A = the graph Laplacian of the unknowns, b = their measured neighbours; r = b -
    // A x.
    let residual = |x: &[f64], out: &mut [f64]| {
        for (k, near) in around.iter().enumerate() {
            out[k] = near.iter().map(|&j| x[j]).sum::<f64>() - near.len() as f64 * x[unknowns[k]];
        }
    };
    let n = unknowns.len();
    let mut r = vec![0.0; n];
    residual(depth, &mut r);
    let precondition =
        |r: &[f64]| -> Vec<f64> { r.iter().zip(&around).map(|(r, a)| r / a.len().max(1) as f64).collect() };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut z = precondition(&r);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let mut q = vec![0.0; n];
    for _ in 0..4 * n {
        if r.iter().all(|e| e.abs() < TOLERANCE) {
            break;
        }
        for (k, near) in around.iter().enumerate() {
            let coupled: f64 = near.iter().filter(|&&j| number[j] != usize::MAX).map(|&j| p[number[j]]).sum();
            q[k] = near.len() as f64 * p[k] - coupled;
        }
        let alpha = rz / dot(&p, &q);
        for k in 0..n {
            depth[unknowns[k]] += alpha * p[k];
            r[k] -= alpha * q[k];
        }
        z = precondition(&r);
        let next = dot(&r, &z);
        for k in 0..n {
            p[k] = z[k] + next / rz * p[k];
        }
        rz = next;
    }
    Some(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fills a hole in a field; returns the largest error in it.
    fn error(field: impl Fn(f64, f64) -> f64) -> f64 {
        let (w, h) = (48, 40);
        let mut mask = Mask::new(w, h);
        mask.set.fill(true);
        let truth: Vec<f64> = (0..w * h).map(|i| field((i % w) as f64, (i / w) as f64)).collect();
        let mut depth = truth.clone();
        for v in 8..32 {
            for u in 6..(20 + v / 2) {
                depth[v * w + u] = 0.0;
            }
        }
        assert!(fill(&mut depth, &mask).unwrap() > 500);
        depth.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn exact_on_harmonic_fields() {
        assert!(error(|u, v| 0.3 + 1e-3 * u - 2e-3 * v) < 1e-6, "linear");
        assert!(error(|u, v| 0.5 + 1e-5 * (u * u - v * v) + 2e-5 * u * v) < 1e-6, "saddle");
        assert!(error(|u, v| 0.5 + 1e-5 * (u * u + v * v)) > 1e-4, "a bowl is not harmonic: the test can fail");
    }

    #[test]
    fn natural_at_the_edge_and_honest_without_data() {
        let mut mask = Mask::new(20, 1);
        mask.set.fill(true);
        let mut depth = vec![0.0; 20];
        assert_eq!(fill(&mut depth, &mask), None);
        depth[3] = 0.25;
        assert_eq!(fill(&mut depth, &mask), Some(19));
        assert!(depth.iter().all(|z| (z - 0.25).abs() < 1e-6));
    }
}
