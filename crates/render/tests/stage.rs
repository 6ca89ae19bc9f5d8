//! The ray tracer on stages with known pictures.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod common;

use common::{quad, sphere};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;
use trocar_camera::{Camera, CameraModel, Distortion, Fisheye};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{
    Appearance, Error, Film, Light, Noise, Picture, RayGenerator, RenderSettings, Stage, SurfaceKind, render,
};

fn camera(width: usize, height: usize) -> Camera {
    Camera::centred(width, height, 1.2)
}

fn preview(stage: &mut Stage, eye: &RayGenerator, pose: &Pose) -> Picture {
    render(stage, eye, pose, &RenderSettings::preview(), &Film::default())
}

fn lit(lights: Vec<Light>, environment: f32) -> Stage {
    let mut stage = Stage::new();
    stage.lights = lights;
    stage.environment = [environment; 3];
    stage
}

fn askew() -> Pose {
    Pose {
        rotation: DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(0.3),
        translation: DVec3::new(0.1, -0.2, 0.05),
    }
}

fn models() -> Vec<CameraModel> {
    let lens = Distortion([-0.12, 0.03, 1.2e-3, -1.1e-4, -0.002, 0.0, 0.0, 0.0]);
    vec![
        camera(160, 120).into(),
        Camera { distortion: lens, ..camera(160, 120) }.into(),
        CameraModel::Fisheye(camera(160, 120), Fisheye([-0.02, 0.003, 0.0, 0.0])),
    ]
}

#[test]
fn depth_labels_and_normals_are_exact_for_every_lens() {
    let pose = askew();
    let middle = DVec3::new(0.01, 0.02, 0.3);
    let normal = DVec3::new(0.25, -0.4, -1.0).normalize();
    let (x, y) = normal.any_orthonormal_pair();
    let corner = pose.transform(middle - x - y);
    let plane = quad(corner, pose.rotation * (2.0 * x), pose.rotation * (2.0 * y));
    let (ball, radius) = (DVec3::new(-0.02, 0.01, 0.2), 0.03);
    for model in models() {
        let mut stage = Stage::new();
        stage.add_mesh(&plane, 7, &Appearance::matte([200; 3])).unwrap();
        stage.add_mesh(&sphere(pose.transform(ball), radius, 240), 3, &Appearance::steel()).unwrap();
        let picture = preview(&mut stage, &RayGenerator::new(model), &pose);
        let (mut checked, mut balls) = (0, 0);
        for i in 0..160 * 120 {
            let ray = model.unproject((i % 160) as f64, (i / 160) as f64).unwrap();
            let along = ray.dot(ball);
            let aside2 = ball.length_squared() - along * along;
            // Skip the edge of the ball, which is a polygon.
            if (aside2.sqrt() - radius).abs() < 1e-4 {
                continue;
            }
            let hits_ball = aside2 < radius * radius;
            let t = if hits_ball {
                along - (radius * radius - aside2).sqrt()
            } else {
                normal.dot(middle) / normal.dot(ray)
            };
            let depth = f64::from(picture.depth.depth[i]);
            assert_eq!(picture.labels[i], if hits_ball { 3 } else { 7 }, "pixel {i}");
            let tolerance = if hits_ball { 1e-4 } else { 1e-6 };
            assert!((depth - t * ray.z).abs() < tolerance, "pixel {i}: {depth} against {}", t * ray.z);
            let expected = if hits_ball { (ray * t - ball) / radius } else { normal };
            let angle = DVec3::from(picture.normals[i].map(f64::from)).angle_between(expected);
            assert!(angle < if hits_ball { 0.02 } else { 1e-3 }, "pixel {i}: normal is {angle} off");
            checked += 1;
            balls += usize::from(hits_ball);
        }
        assert!(checked > 18_000 && balls > 500, "{checked} {balls}");
    }
}

#[test]
fn placing_a_body_equals_moving_its_vertices() {
    let pose = Pose { rotation: DQuat::from_rotation_y(0.7), translation: DVec3::new(0.02, -0.01, 0.25) };
    let shape = sphere(DVec3::new(0.03, 0.0, 0.0), 0.04, 12);
    let moved = TriMesh { vertices: shape.vertices.iter().map(|p| pose.transform(*p)).collect(), ..shape.clone() };
    let eye = RayGenerator::new(camera(120, 90));
    let mut placed = Stage::new();
    let id = placed.add_shape(&shape).unwrap();
    let far = Pose { translation: DVec3::Z, ..Pose::IDENTITY };
    let body = placed.add_body(id, &far, 1, &Appearance::steel()).unwrap();
    placed.add_body(id, &pose, 2, &Appearance::steel()).unwrap();
    preview(&mut placed, &eye, &Pose::IDENTITY);
    placed.place(body, &Pose { translation: DVec3::new(0.0, 0.0, -1.0), ..Pose::IDENTITY }).unwrap();
    let mut baked = Stage::new();
    baked.add_mesh(&moved, 2, &Appearance::steel()).unwrap();
    let (a, b) = (preview(&mut placed, &eye, &Pose::IDENTITY), preview(&mut baked, &eye, &Pose::IDENTITY));
    let meeting = placed.cast(glam::Vec3::ZERO, glam::Vec3::new(0.02, -0.01, 0.25)).unwrap();
    assert!(meeting.body != body && meeting.t < 1.0);
    assert_eq!(placed.cast(glam::Vec3::ZERO, glam::Vec3::X), None);
    let differ = (0..a.labels.len()).filter(|i| a.labels[*i] != b.labels[*i]).count();
    assert!(differ <= 4, "{differ} pixels");
    let off = a.depth.depth.iter().zip(&b.depth.depth).filter(|(x, y)| (*x - *y).abs() > 1e-6).count();
    assert!(off <= 8, "{off} depths");
    assert!(a.labels.iter().filter(|l| **l == 2).count() > 500);
}

#[test]
fn deformed_shape_equals_rebuilt_shape() {
    let rest = sphere(DVec3::new(0.0, 0.0, 0.3), 0.06, 40);
    let bent: Vec<DVec3> = rest
        .vertices
        .iter()
        .map(|p| *p + DVec3::new(0.03 * (40.0 * p.y).sin(), 0.0, 0.02 * (50.0 * p.x).cos()))
        .collect();
    let eye = RayGenerator::new(camera(120, 90));
    let lights = vec![Light::endoscope(&Pose::IDENTITY, 0.01, 0.2)];
    let mut deformed = lit(lights.clone(), 0.0);
    let (shape, _) = deformed.add_mesh(&rest, 1, &Appearance::tissue([180, 80, 70])).unwrap();
    preview(&mut deformed, &eye, &Pose::IDENTITY);
    deformed.deform(shape, &bent).unwrap();
    let mut rebuilt = lit(lights, 0.0);
    rebuilt.add_mesh(&TriMesh { vertices: bent, ..rest }, 1, &Appearance::tissue([180, 80, 70])).unwrap();
    assert_eq!(preview(&mut deformed, &eye, &Pose::IDENTITY), preview(&mut rebuilt, &eye, &Pose::IDENTITY));
}

#[test]
fn picture_does_not_depend_on_thread_count() {
    let picture = |threads: usize, settings: &RenderSettings| {
        let mut stage = lit(Vec::new(), 0.1);
        stage.lights.push(Light::endoscope(&Pose::IDENTITY, 0.005, 0.2));
        stage.add_mesh(&sphere(DVec3::new(0.0, 0.0, 0.25), 0.05, 20), 1, &Appearance::tissue([180, 80, 70])).unwrap();
        let floor = quad(DVec3::new(-1.0, -1.0, 0.35), 2.0 * DVec3::X, 2.0 * DVec3::Y);
        stage.add_mesh(&floor, 2, &Appearance::steel()).unwrap();
        let film = Film { noise: Some(Noise { shot: 0.02, read: 0.005, seed: 4, frame: 2 }), ..Film::endoscope() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&mut stage, &RayGenerator::new(camera(61, 47)), &Pose::IDENTITY, settings, &film))
    };
    for settings in [RenderSettings::preview(), RenderSettings::path(4), RenderSettings::denoised(4)] {
        assert!(picture(1, &settings) == picture(2, &settings), "{settings:?}");
    }
    let other = RenderSettings::Path { samples: 4, bounces: 8, seed: 1, denoise: false };
    assert!(picture(1, &other) != picture(1, &RenderSettings::path(4)), "another seed gives other noise");
}

#[test]
fn white_body_is_invisible_in_a_white_room() {
    let kinds = [
        SurfaceKind::Matte,
        SurfaceKind::Metal { roughness: 0.3 },
        SurfaceKind::Metal { roughness: 0.9 },
        SurfaceKind::Coated { roughness: 0.3, ior: 1.4, scattering_length: [0.0; 3] },
        SurfaceKind::Coated { roughness: 0.3, ior: 1.4, scattering_length: [2e-3, 1e-3, 0.5e-3] },
    ];
    for kind in kinds {
        let mut stage = lit(Vec::new(), 1.0);
        let look = Appearance { color: [255; 3], surface: kind };
        stage.add_mesh(&sphere(DVec3::new(0.0, 0.0, 0.3), 0.1, 300), 1, &look).unwrap();
        let eye = RayGenerator::new(camera(32, 32));
        let settings = RenderSettings::Path { samples: 256, bounces: 32, seed: 3, denoise: false };
        let picture = render(&mut stage, &eye, &Pose::IDENTITY, &settings, &Film::default());
        let seen: Vec<usize> = (0..32 * 32).filter(|i| picture.labels[*i] == 1).collect();
        assert!(seen.len() > 100);
        for k in 0..3 {
            let mean = seen.iter().map(|i| f64::from(picture.light[*i][k])).sum::<f64>() / seen.len() as f64;
            assert!((mean - 1.0).abs() < 0.01, "{kind:?}: channel {k} gives {mean}");
        }
    }
}

#[test]
fn panel_light_matches_its_form_factor() {
    // View factor of a point below the centre of a parallel square with half side a at height h, in
    // closed form.
    let (a, h) = (0.1_f64, 0.15_f64);
    let mut stage = Stage::new();
    stage.lights.push(Light::Panel {
        corner: DVec3::new(-a, -a, 0.3 - h),
        along: 2.0 * a * DVec3::X,
        across: 2.0 * a * DVec3::Y,
        radiance: [2.0; 3],
    });
    let floor = quad(DVec3::new(-1.0, -1.0, 0.3), 2.0 * DVec3::X, 2.0 * DVec3::Y);
    stage.add_mesh(&floor, 1, &Appearance::matte([255; 3])).unwrap();
    // Seen from the side, below the panel, with a field of view of a millimetre around the centre.
    let pose = Pose::look_at(DVec3::new(0.1, 0.0, 0.2), DVec3::new(0.0, 0.0, 0.3), DVec3::Y);
    let eye = RayGenerator::new(Camera::centred(8, 8, 0.005));
    let settings = RenderSettings::Path { samples: 4000, bounces: 4, seed: 0, denoise: false };
    let picture = render(&mut stage, &eye, &pose, &settings, &Film::default());
    let mean = picture.light.iter().map(|l| f64::from(l[0])).sum::<f64>() / 64.0;
    let x = a / (a * a + h * h).sqrt();
    let factor = 4.0 / PI * x * (a / (a * a + h * h).sqrt()).atan();
    assert!((mean / (2.0 * factor) - 1.0).abs() < 0.01, "{mean} against {}", 2.0 * factor);
}

#[test]
fn spot_light_falls_off_with_the_square_and_ends_at_its_cone() {
    let light = |distance: f64, aim: DVec3| {
        let mut stage = Stage::new();
        let (inner, outer) = (0.3, 0.4);
        stage.lights.push(Light::Spot { position: DVec3::ZERO, direction: aim, intensity: [1.0; 3], inner, outer });
        let floor = quad(DVec3::new(-1.0, -1.0, distance), 2.0 * DVec3::X, 2.0 * DVec3::Y);
        stage.add_mesh(&floor, 1, &Appearance::matte([255; 3])).unwrap();
        let eye = RayGenerator::new(Camera::centred(1, 1, 0.01));
        preview(&mut stage, &eye, &Pose::IDENTITY).light[0][0]
    };
    let near = light(0.1, DVec3::Z);
    assert!((f64::from(near) - 100.0 / PI).abs() < 0.01, "{near}");
    assert!((near / light(0.2, DVec3::Z) - 4.0).abs() < 1e-3);
    assert_eq!(light(0.1, DVec3::new(0.5, 0.0, 1.0)), 0.0);
    let edge = light(0.1, DVec3::new(0.35_f64.tan(), 0.0, 1.0));
    assert!(edge > 0.0 && edge < near);
}

#[test]
fn lamp_beside_the_lens_casts_a_shadow_in_both_settings() {
    let mut stage = Stage::new();
    let position = DVec3::new(0.1, 0.0, 0.0);
    stage.lights.push(Light::Spot { position, direction: DVec3::Z, intensity: [0.1; 3], inner: PI, outer: PI });
    let floor = quad(DVec3::new(-1.0, -1.0, 0.3), 2.0 * DVec3::X, 2.0 * DVec3::Y);
    stage.add_mesh(&floor, 1, &Appearance::matte([255; 3])).unwrap();
    stage.add_mesh(&sphere(DVec3::new(0.0, 0.0, 0.2), 0.02, 30), 2, &Appearance::matte([255; 3])).unwrap();
    let camera = camera(90, 60);
    let at = |picture: &Picture, x: f64| {
        let p = camera.project(DVec3::new(x, 0.0, 0.3)).unwrap().round();
        let i = p.y as usize * 90 + p.x as usize;
        assert_eq!(picture.labels[i], 1, "the floor at {x}");
        picture.light[i][0]
    };
    // The lamp's ray through the centre of the ball meets the floor at x = -0.05.
    for settings in
        [RenderSettings::preview(), RenderSettings::Path { samples: 4, bounces: 1, seed: 0, denoise: false }]
    {
        let picture = render(&mut stage, &RayGenerator::new(camera), &Pose::IDENTITY, &settings, &Film::default());
        assert_eq!(at(&picture, -0.05), 0.0, "{settings:?}");
        assert!(at(&picture, 0.06) > 0.0, "{settings:?}");
    }
    let without = RenderSettings::Preview { shadows: false };
    let picture = render(&mut stage, &RayGenerator::new(camera), &Pose::IDENTITY, &without, &Film::default());
    assert!(at(&picture, -0.05) > 0.0);
}

#[test]
fn film_applies_exposure_vignette_noise_and_shoulder() {
    let mut stage = lit(Vec::new(), 0.25);
    let eye = RayGenerator::new(camera(200, 100)).with_circular_image(0.9);
    let shot =
        |stage: &mut Stage, film: &Film| render(stage, &eye, &Pose::IDENTITY, &RenderSettings::preview(), film).color;
    let plain = shot(&mut stage, &Film { exposure: 2.0, ..Film::default() });
    assert_eq!(plain.pixels[50 * 200 + 100], [188; 3], "half the light");
    assert_eq!(plain.pixels[50 * 200 + 10], [0; 3], "outside of the circle");
    let inside = plain.pixels.iter().filter(|p| **p != [0; 3]).count() as f64;
    assert!((inside / (PI * 45.0 * 45.0) - 1.0).abs() < 0.02, "{inside} pixels");
    let dim = shot(&mut stage, &Film { vignette: 0.5, ..Film::default() });
    assert!(dim.pixels[50 * 200 + 60][0] < dim.pixels[50 * 200 + 100][0]);
    let noisy = |stage: &mut Stage, frame| {
        shot(
            stage,
            &Film { exposure: 2.0, noise: Some(Noise { shot: 0.0, read: 0.02, seed: 1, frame }), ..Film::default() },
        )
    };
    let (a, b) = (noisy(&mut stage, 0), noisy(&mut stage, 1));
    assert!(a != b && a == noisy(&mut stage, 0));
    let values: Vec<f64> =
        a.pixels.iter().filter(|p| p[1] > 100).map(|p| f64::from(trocar_render::srgb::to_linear(*p)[1])).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
    assert!((mean - 0.5).abs() < 2e-3 && (spread - 0.02).abs() < 2e-3, "{mean} +- {spread}");
    assert!(
        shot(&mut stage, &Film { exposure: 50.0, shoulder: 0.7, ..Film::default() }).pixels[50 * 200 + 100] == [255; 3]
    );
}

#[test]
fn mismatches_are_rejected_and_invalid_input_is_handled() {
    let mut stage = Stage::new();
    let (shape, _) = stage.add_mesh(&sphere(DVec3::Z, 0.1, 8), 1, &Appearance::steel()).unwrap();
    let other = Stage::new().add_body(shape, &Pose::IDENTITY, 1, &Appearance::steel());
    assert_eq!(other.unwrap_err().to_string(), "there is no shape 0; the stage has 0");
    let error = stage.deform(shape, &[DVec3::ZERO]).unwrap_err();
    assert_eq!(error, Error::Vertices { shape: 0, has: 144, given: 1 });

    let mut broken = sphere(DVec3::Z, 0.1, 8);
    broken.vertices[20] = DVec3::NAN;
    broken.vertices[40] = DVec3::splat(1e300);
    broken.triangles.push([0, 1, 99_999]);
    let odd = Appearance {
        color: [255; 3],
        surface: SurfaceKind::Coated {
            roughness: f32::NAN,
            ior: f32::INFINITY,
            scattering_length: [f32::NAN, -1.0, 1e30],
        },
    };
    let (shape, body) = stage.add_mesh(&broken, 2, &odd).unwrap();
    stage.lights.push(Light::endoscope(&Pose::IDENTITY, 0.0, f64::NAN));
    stage.lights.push(Light::Panel { corner: DVec3::ZERO, along: DVec3::ZERO, across: DVec3::NAN, radiance: [1.0; 3] });
    let eyes = [RayGenerator::new(camera(16, 16)), RayGenerator::new(camera(16, 16)).with_circular_image(f32::NAN)];
    for eye in &eyes {
        for settings in [RenderSettings::preview(), RenderSettings::path(2)] {
            render(&mut stage, eye, &Pose::IDENTITY, &settings, &Film { exposure: f32::NAN, ..Film::default() });
        }
    }
    stage.deform(shape, &vec![DVec3::NAN; 144]).unwrap();
    stage.place(body, &Pose { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), translation: DVec3::NAN }).unwrap();
    render(&mut stage, &eyes[0], &Pose::IDENTITY, &RenderSettings::path(2), &Film::default());
    assert!(preview(&mut Stage::new(), &eyes[0], &Pose::IDENTITY).labels.iter().all(|l| *l == 0));
}

#[test]
fn tile_agrees_with_single_rays() {
    let mut stage = Stage::new();
    let shape = stage.add_shape(&sphere(DVec3::ZERO, 0.03, 60)).unwrap();
    for i in 0..40 {
        let turn = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(2.0 * f64::from(i));
        // Balls in all directions around the camera; some enclose it.
        let pose = Pose { rotation: turn, translation: turn * DVec3::new(0.0, 0.0, 0.004 * f64::from(i)) };
        stage.add_body(shape, &pose, i as u16 + 1, &Appearance::steel()).unwrap();
    }
    for model in models() {
        let camera = *model.camera();
        for pose in [Pose::IDENTITY, askew(), Pose::look_at(DVec3::new(0.3, 0.1, 0.0), DVec3::ZERO, DVec3::Z)] {
            let picture = preview(&mut stage, &RayGenerator::new(model), &pose);
            let mut differing = 0;
            for i in (0..camera.width * camera.height).step_by(7) {
                let ray = model.unproject((i % camera.width) as f64, (i / camera.width) as f64).unwrap();
                let ray = if matches!(model, CameraModel::Pinhole(_)) { ray / ray.z } else { ray };
                let found = stage.cast(pose.translation.as_vec3(), (pose.rotation * ray).as_vec3());
                let depth = found.map_or(0.0, |m| m.t * ray.z as f32);
                // This test rotates the ray in another precision.
                let off = (depth - picture.depth.depth[i]).abs();
                differing += usize::from(off > 1e-4);
            }
            // Differences occur at silhouettes only.
            assert!(differing <= 8, "{differing} of 2743 pixels");
        }
    }
}
