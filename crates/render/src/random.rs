//! Stateless random numbers: a hash of their key. Pictures do not depend on the number of threads.

/// Four uniform numbers in [0, 1) for a key such as (pixel, sample, purpose, seed): `pcg4d` of
/// Jarzynski and Olano, "Hash Functions for GPU Rendering" (2020).
pub fn numbers(key: [u32; 4]) -> [f32; 4] {
    let [mut x, mut y, mut z, mut w] = key.map(|k| k.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    let stir = |x: &mut u32, y: &mut u32, z: &mut u32, w: &mut u32| {
        *x = x.wrapping_add(y.wrapping_mul(*w));
        *y = y.wrapping_add(z.wrapping_mul(*x));
        *z = z.wrapping_add(x.wrapping_mul(*y));
        *w = w.wrapping_add(y.wrapping_mul(*z));
    };
    stir(&mut x, &mut y, &mut z, &mut w);
    [x, y, z, w] = [x, y, z, w].map(|n| n ^ (n >> 16));
    stir(&mut x, &mut y, &mut z, &mut w);
    // 24 bits: the resolution of single precision below 1.
    [x, y, z, w].map(|n| (n >> 8) as f32 * (1.0 / 16_777_216.0))
}

/// Two standard normal numbers from two uniform numbers in [0, 1) (Box and Muller).
pub fn normal(a: f32, b: f32) -> [f32; 2] {
    let radius = (-2.0 * (1.0 - a).ln()).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
    [radius * cos, radius * sin]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_uncorrelated() {
        const N: u32 = 100_000;
        let mut sums = [0.0_f64; 4];
        let mut products = [0.0_f64; 4];
        for i in 0..N {
            let (a, b) = (numbers([i, 7, 1, 2]), numbers([i + 1, 7, 1, 2]));
            for k in 0..4 {
                sums[k] += f64::from(a[k]) - 0.5;
                products[k] += (f64::from(a[k]) - 0.5) * (f64::from(b[k]) - 0.5);
            }
        }
        // Five standard deviations.
        for k in 0..4 {
            assert!((sums[k] / f64::from(N)).abs() < 5.0 * (1.0 / 12.0 / f64::from(N)).sqrt());
            assert!((products[k] / f64::from(N)).abs() < 5.0 / 12.0 / f64::from(N).sqrt());
        }
    }
}
