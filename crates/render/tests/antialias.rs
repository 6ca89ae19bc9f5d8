//! Smooth edges beside pictures of twice the size, averaged.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod common;

use common::{quad, sphere};
use glam::DVec3;
use trocar_camera::{Camera, CameraModel, Distortion, Fisheye};
use trocar_core::Pose;
use trocar_render::{Appearance, Film, Light, Noise, Picture, RayGenerator, RenderSettings, Stage, render};

/// Balls before a wall, which lie in the shadow of one another.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let wall = quad(DVec3::new(-0.3, -0.3, 0.4), 0.6 * DVec3::X, 0.6 * DVec3::Y);
    stage.add_mesh(&wall, 1, &Appearance::matte([220, 200, 120])).unwrap();
    for k in 0..7_u16 {
        let t = f64::from(k);
        let middle = DVec3::new(0.09 * (1.7 * t).sin(), 0.07 * (2.3 * t).cos(), 0.22 + 0.02 * t);
        stage.add_mesh(&sphere(middle, 0.03, 80), 2 + k, &Appearance::tissue([190, 90, 80])).unwrap();
    }
    let corner = DVec3::new(-0.5, 0.1, -0.4);
    stage.lights = vec![
        Light::endoscope(&Pose::IDENTITY, 0.0025, 0.12),
        Light::Panel { corner, along: 0.3 * DVec3::X, across: 0.3 * DVec3::Y, radiance: [9.0; 3] },
    ];
    stage
}

fn seen(model: CameraModel, settings: &RenderSettings, film: &Film) -> Picture {
    render(&mut stage(), &RayGenerator::new(model), &Pose::IDENTITY, settings, film)
}

/// Root mean square of the difference from the reference, of 255.
fn error(picture: &Picture, reference: &[[f64; 3]]) -> f64 {
    let pairs = picture.color.pixels.as_flattened().iter().zip(reference.as_flattened());
    (pairs.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>() / reference.len() as f64 / 3.0).sqrt()
}

#[test]
fn smooth_edges_are_those_of_four_points_a_pixel_for_every_lens() {
    let camera = Camera::centred(204, 150, 1.1);
    let barrel = Distortion([-0.28, 0.09, 1.2e-3, -1.1e-4, -0.012, 0.0, 0.0, 0.0]);
    let lenses: [CameraModel; 3] = [
        camera.into(),
        Camera { distortion: barrel, ..camera }.into(),
        CameraModel::Fisheye(camera, Fisheye([-0.02, 0.003, 0.0, 0.0])),
    ];
    for lens in lenses {
        let film = Film::endoscope();
        let fine = seen(lens.finer(2), &RenderSettings::preview(), &film).color;
        let mean = |i: usize| {
            let at = 2 * (i / camera.width) * fine.width + 2 * (i % camera.width);
            let four = [at, at + 1, at + fine.width, at + fine.width + 1].map(|j| fine.pixels[j]);
            [0, 1, 2].map(|c| four.iter().map(|p| f64::from(p[c])).sum::<f64>() / 4.0)
        };
        let reference: Vec<[f64; 3]> = (0..camera.width * camera.height).map(mean).collect();
        let plain = seen(lens, &RenderSettings::preview(), &film);
        let smooth = seen(lens, &RenderSettings::Smooth, &film);
        let (rough, left) = (error(&plain, &reference), error(&smooth, &reference));
        assert!(rough > 3.0 && left < 0.2 * rough, "{lens:?}: {rough} without, {left} with");
        // All but the colours is that of the preview.
        assert!(smooth == Picture { color: smooth.color.clone(), ..plain }, "{lens:?}");
    }
}

#[test]
fn a_picture_with_noise_is_a_preview() {
    let noise = Some(Noise { shot: 0.015, read: 0.003, seed: 1, frame: 2 });
    let (camera, film) = (Camera::centred(64, 48, 1.1), Film { noise, ..Film::endoscope() });
    let [smooth, plain] = [RenderSettings::Smooth, RenderSettings::preview()].map(|s| seen(camera.into(), &s, &film));
    assert!(smooth == plain);
}
