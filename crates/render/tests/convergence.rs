//! The error of path tracing falls faster than with the square root of the number of samples, in a
//! box lit from its ceiling: the samples of a pixel are a low-discrepancy sequence.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod common;

use common::{quad, sphere};
use glam::DVec3;
use trocar_camera::Camera;
use trocar_core::Pose;
use trocar_render::{Appearance, Film, Light, RayGenerator, RenderSettings, Stage, render};

/// A Cornell-like box of 10 cm, open towards the camera, with a tissue ball and a steel ball.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let (x, y, z) = (0.1 * DVec3::X, 0.1 * DVec3::Y, 0.1 * DVec3::Z);
    let o = DVec3::new(-0.05, -0.05, 0.1);
    let walls = [
        (quad(o + z, x, y), [190; 3]),
        (quad(o, x, z), [190; 3]),
        (quad(o + y, x, z), [190; 3]),
        (quad(o, y, z), [190, 30, 30]),
        (quad(o + x, y, z), [30, 170, 40]),
    ];
    for (wall, color) in walls {
        stage.add_mesh(&wall, 1, &Appearance::matte(color)).unwrap();
    }
    stage.add_mesh(&sphere(DVec3::new(-0.02, 0.03, 0.16), 0.02, 40), 2, &Appearance::tissue([200, 90, 80])).unwrap();
    stage.add_mesh(&sphere(DVec3::new(0.02, 0.035, 0.15), 0.015, 40), 3, &Appearance::steel()).unwrap();
    stage.lights.push(Light::Panel {
        corner: DVec3::new(-0.02, -0.0499, 0.13),
        along: 0.04 * DVec3::Z,
        across: 0.04 * DVec3::X,
        radiance: [6.0; 3],
    });
    stage
}

#[test]
fn error_falls_faster_than_with_the_square_root_of_the_samples() {
    let eye = RayGenerator::new(Camera::centred(24, 24, 0.9));
    let mut stage = stage();
    let mut light = |samples: u32, seed: u32| -> Vec<f64> {
        let settings = RenderSettings::Path { samples, bounces: 6, seed, denoise: false };
        let picture = render(&mut stage, &eye, &Pose::IDENTITY, &settings, &Film::default());
        picture.light.iter().flatten().map(|l| f64::from(*l)).collect()
    };
    let truth = light(4096, 1000);
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    assert!(mean > 0.1, "the box is lit: {mean}");
    let mut error = |samples: u32| {
        // Several seeds, so that the estimate is good to 0.05.
        let squares: f64 =
            (0..4).map(|seed| light(samples, seed).iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>()).sum();
        (squares / (4.0 * truth.len() as f64)).sqrt()
    };
    let (few, many) = (error(4), error(128));
    let power = (few / many).ln() / 32.0_f64.ln();
    assert!(power > 0.7, "error {few} at 4 samples, {many} at 128: samples to the power -{power}");
}

/// The filter halves the error of a picture of few paths, and changes its mean colour by little.
#[test]
fn noise_is_filtered_out() {
    let eye = RayGenerator::new(Camera::centred(160, 160, 0.9));
    let mut stage = stage();
    let mut picture = |samples: u32, seed: u32, denoise: bool| -> Vec<f64> {
        let settings = RenderSettings::Path { samples, bounces: 6, seed, denoise };
        let picture = render(&mut stage, &eye, &Pose::IDENTITY, &settings, &Film::default());
        picture.color.pixels.iter().flatten().map(|c| f64::from(*c)).collect()
    };
    let (truth, raw, filtered) = (picture(200, 1000, false), picture(4, 1, false), picture(4, 1, true));
    let error =
        |made: &[f64]| (made.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / truth.len() as f64).sqrt();
    assert!(error(&filtered) < 0.6 * error(&raw), "4 paths: {}, filtered: {}", error(&raw), error(&filtered));
    let mean = |made: &[f64]| made.iter().sum::<f64>() / made.len() as f64;
    assert!((mean(&filtered) - mean(&truth)).abs() < 1.0, "mean {} and {}", mean(&filtered), mean(&truth));
}
