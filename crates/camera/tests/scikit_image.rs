//! SSIM and PSNR agree with scikit-image to 1e-6. Skipped with a message without scikit-image.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

use std::process::Command;
use trocar_camera::Mask;
use trocar_camera::metrics::{psnr_db, ssim};
use trocar_core::Random;
use trocar_testing::python_with;

const WIDTH: usize = 120;
const HEIGHT: usize = 80;
/// Half the window. Nearer to the border the two differ in the treatment of pixels beyond it.
const REACH: usize = 5;

/// A picture of blobs, and the same picture with noise and another exposure.
fn pictures(strength: f64) -> [Vec<[f64; 3]>; 2] {
    let mut numbers = Random::new(7).sequence();
    let mut all = [Vec::new(), Vec::new()];
    for i in 0..WIDTH * HEIGHT {
        let (x, y) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
        let clean: [f64; 3] = [0.0, 1.0, 2.0]
            .map(|c| 120.0 + 60.0 * (0.11 * x + c).sin() * (0.17 * y - c).cos() + 20.0 * (0.9 * x * y / 40.0).sin());
        all[0].push(clean.map(|v| v.round().clamp(0.0, 255.0)));
        all[1].push(clean.map(|v| (0.9 * v + strength * (numbers.uniform() - 0.5)).round().clamp(0.0, 255.0)));
    }
    all
}

#[test]
fn ssim_and_psnr_agree_with_scikit_image() {
    let Some(python) = python_with("skimage.metrics", "scikit-image") else { return };
    for strength in [3.0, 40.0, 200.0] {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = pictures(strength);
        for (name, picture) in [("a", &a), ("b", &b)] {
            let bytes: Vec<u8> = picture.as_flattened().iter().map(|v| *v as u8).collect();
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/oracles/scikit_image.py");
        let size = [WIDTH, HEIGHT].map(|n| n.to_string());
        let output = Command::new(&python).arg(script).arg(folder.path()).args(size).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let bytes = std::fs::read(folder.path().join("out")).unwrap();
        let theirs: Vec<f64> = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let (mean, psnr, map) = (theirs[0], theirs[1], &theirs[2..]);

        let whole = Mask { width: WIDTH, height: HEIGHT, set: vec![true; WIDTH * HEIGHT] };
        let ours = ssim(&a, &b, &whole).unwrap();
        let inner = |i: &usize| {
            let (u, v) = (i % WIDTH, i / WIDTH);
            u >= REACH && v >= REACH && u < WIDTH - REACH && v < HEIGHT - REACH
        };
        let inside: Vec<usize> = (0..WIDTH * HEIGHT).filter(inner).collect();
        let worst = inside.iter().map(|i| (ours.map[*i] - map[*i]).abs()).fold(0.0, f64::max);
        // The mean of scikit-image excludes the border, ours includes it.
        let our_mean = inside.iter().map(|i| ours.map[*i]).sum::<f64>() / inside.len() as f64;
        let our_psnr = psnr_db(&a, &b, &whole).unwrap();
        println!(
            "noise {strength}: SSIM {mean:.4}, off {:.1e}, map off {worst:.1e}; PSNR {psnr:.2} dB, off {:.1e}",
            our_mean - mean,
            our_psnr - psnr
        );
        assert!((our_mean - mean).abs() < 1e-6 && worst < 1e-6 && (our_psnr - psnr).abs() < 1e-6);
        assert!((0.0..0.99).contains(&mean), "the pictures are too similar or unrelated: {mean}");
    }
}
