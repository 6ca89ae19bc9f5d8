//! Rasterised previews against the ray tracer, through every lens.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod common;

use common::{quad, sphere};
use glam::{DQuat, DVec3};
use trocar_camera::{Camera, CameraModel, Distortion, Endoscope, Fisheye};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{
    Appearance, Film, Light, Noise, Picture, RayGenerator, RenderSettings, Stage, SurfaceKind, render, render_into,
};

/// Two pictures of the same stage.
struct Pair {
    raster: Picture,
    traced: Picture,
}

/// How much two pictures differ.
#[derive(Debug)]
struct Difference {
    /// Mean over all pixels and channels, of 255.
    color: f64,
    /// Largest, away from edges (m).
    depth: f32,
    /// Largest angle between normals, away from edges (rad).
    normal: f64,
    /// Share of other labels away from edges.
    labels: f64,
    /// Share of other labels everywhere.
    all_labels: f64,
    /// Pixels that show a body away from edges.
    inner: usize,
}

impl Pair {
    fn new(stage: &mut Stage, rays: &RayGenerator, pose: &Pose, shadows: bool, film: &Film) -> Self {
        let raster = render(stage, rays, pose, &RenderSettings::Preview { shadows }, film);
        let traced = render(stage, rays, pose, &RenderSettings::Traced { shadows }, film);
        Self { raster, traced }
    }

    fn difference(&self) -> Difference {
        let Self { raster, traced } = self;
        let (width, height) = (traced.color.width, traced.color.height);
        let bytes = |p: &Picture| p.color.pixels.as_flattened().to_vec();
        let apart = bytes(raster).into_iter().zip(bytes(traced)).map(|(a, b)| f64::from(a.abs_diff(b))).sum::<f64>();
        let mut found = Difference {
            color: apart / (3 * width * height) as f64,
            depth: 0.0,
            normal: 0.0,
            labels: 0.0,
            all_labels: 0.0,
            inner: 0,
        };
        let differs = |i: usize| usize::from(raster.labels[i] != traced.labels[i]);
        let mut other = 0;
        for v in 1..height - 1 {
            for u in 1..width - 1 {
                let i = v * width + u;
                let (z, label) = (traced.depth.depth[i], traced.labels[i]);
                // An edge: a neighbour has another label, or a depth that differs by a twentieth.
                let around =
                    [i - width - 1, i - width, i - width + 1, i - 1, i + 1, i + width - 1, i + width, i + width + 1];
                let is_edge =
                    |j: &usize| traced.labels[*j] != label || (traced.depth.depth[*j] - z).abs() > 0.05 * z.abs();
                if around.iter().any(is_edge) {
                    continue;
                }
                found.inner += usize::from(label != 0);
                other += differs(i);
                if raster.labels[i] == label && label != 0 {
                    found.depth = found.depth.max((raster.depth.depth[i] - z).abs());
                    let [a, b] = [raster, traced].map(|p| DVec3::from(p.normals[i].map(f64::from)));
                    found.normal = found.normal.max(a.angle_between(b));
                }
            }
        }
        found.labels = other as f64 / found.inner.max(1) as f64;
        found.all_labels = (0..width * height).map(differs).sum::<usize>() as f64 / (width * height) as f64;
        found
    }
}

fn lenses() -> Vec<(&'static str, CameraModel)> {
    let camera = Camera::centred(203, 150, 1.2);
    let barrel = Distortion([-0.28, 0.09, 1.2e-3, -1.1e-4, -0.012, 0.0, 0.0, 0.0]);
    let rational = Distortion([0.5479, -0.0210, -7.21e-5, 2.06e-5, -0.00265, 0.8897, 0.0861, -0.0139]);
    let policy = |camera: Camera| {
        let scale = 224.0 / camera.height as f64;
        let (fx, fy) = (camera.fx * scale, camera.fy * scale);
        Camera { width: 224, height: 224, fx, fy, cx: 111.5, cy: 111.5, ..camera }
    };
    let wide = Camera { fx: 75.0, fy: 75.0, ..camera };
    vec![
        ("pinhole", camera.into()),
        ("endoscope", policy(Endoscope::thirty_degrees().camera).into()),
        ("d405", policy(Camera::d405()).into()),
        ("barrel", Camera { distortion: barrel, ..camera }.into()),
        ("rational", Camera { distortion: rational, ..policy(Camera::d405()) }.into()),
        ("fisheye", CameraModel::Fisheye(camera, Fisheye([-0.02, 0.003, 0.0, 0.0]))),
        ("fisheye of 190 degrees", CameraModel::Fisheye(wide, Fisheye([-0.01, 0.001, 0.0, 0.0]))),
    ]
}

/// Bowls, balls, rods and a floor around the origin: large triangles beside small ones, open and
/// closed shapes, every kind of surface.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let coat = |scattering_length| SurfaceKind::Coated { roughness: 0.35, ior: 1.4, scattering_length };
    let looks = [
        Appearance::tissue([190, 90, 80]),
        Appearance::steel(),
        Appearance { color: [90, 160, 120], surface: coat([0.0; 3]) },
        Appearance::matte([220, 200, 120]),
    ];
    let bumpy = |rings: u32| {
        let mut mesh = sphere(DVec3::ZERO, 0.03, rings);
        for p in &mut mesh.vertices {
            *p *= 1.0 + 0.1 * (90.0 * p.x).sin() * (70.0 * p.y).cos();
        }
        mesh
    };
    let fine = stage.add_shape(&bumpy(120)).unwrap();
    let coarse = stage.add_shape(&bumpy(14)).unwrap();
    let mut bowl = bumpy(40);
    bowl.triangles.retain(|t| t.iter().all(|v| bowl.vertices[*v as usize].z > -0.005));
    let bowl = stage.add_shape(&bowl).unwrap();
    let rod =
        TriMesh { vertices: bumpy(20).vertices.iter().map(|p| *p * DVec3::new(0.1, 0.1, 4.0)).collect(), ..bumpy(20) };
    let rod = stage.add_shape(&rod).unwrap();
    for i in 0..24_u16 {
        let turn = DQuat::from_rotation_y(2.4 * f64::from(i)) * DQuat::from_rotation_x(1.1 * f64::from(i));
        let pose = Pose { rotation: turn, translation: turn * DVec3::new(0.02, 0.0, 0.09 + 0.006 * f64::from(i)) };
        let shape = [fine, coarse, bowl, rod][usize::from(i) % 4];
        stage.add_body(shape, &pose, i + 1, &looks[usize::from(i / 4) % 4]).unwrap();
    }
    let floor = quad(DVec3::new(-2.0, -2.0, 0.33), 4.0 * DVec3::X, 4.0 * DVec3::Y);
    stage.add_mesh(&floor, 90, &looks[3]).unwrap();
    stage.environment = [0.06, 0.05, 0.05];
    stage
}

fn poses() -> Vec<Pose> {
    let askew = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(0.3);
    vec![
        Pose::IDENTITY,
        Pose { rotation: askew, translation: DVec3::new(0.01, -0.02, 0.005) },
        Pose::look_at(DVec3::new(0.3, 0.1, -0.1), DVec3::ZERO, DVec3::Z),
        Pose::look_at(DVec3::new(-0.05, 0.28, 0.05), DVec3::new(0.0, 0.0, 0.1), DVec3::Z),
    ]
}

#[test]
fn raster_equals_traced_through_every_lens() {
    let mut stage = stage();
    for (name, model) in lenses() {
        for (k, pose) in poses().iter().enumerate() {
            stage.lights = vec![
                Light::endoscope(pose, 0.0025, 0.12),
                Light::Panel {
                    corner: DVec3::new(-0.5, -0.5, -0.9),
                    along: DVec3::X,
                    across: DVec3::Y,
                    radiance: [0.8, 0.9, 1.0],
                },
            ];
            for rays in [RayGenerator::new(model), RayGenerator::new(model).with_circular_image(0.8)] {
                let pair = Pair::new(&mut stage, &rays, pose, false, &Film::endoscope());
                let found = pair.difference();
                let at = format!("{name}, pose {k}: {found:?}");
                assert!(found.color < 0.2, "{at}");
                assert!(found.depth < 1e-5 && found.normal < 0.02, "{at}");
                assert!(found.labels == 0.0 && found.all_labels < 5e-4, "{at}");
                assert!(found.inner > 1500, "{at}");
            }
        }
    }
}

#[test]
fn shadows_equal_traced_shadows() {
    let mut stage = stage();
    stage.lights = vec![Light::Panel {
        corner: DVec3::new(-0.5, 0.1, -0.9),
        along: DVec3::X,
        across: DVec3::Y,
        radiance: [6.0; 3],
    }];
    let rays = RayGenerator::new(Camera::centred(203, 150, 1.2));
    for pose in poses() {
        let with = Pair::new(&mut stage, &rays, &pose, true, &Film::default());
        let without = Pair::new(&mut stage, &rays, &pose, false, &Film::default());
        assert!(with.difference().color < 0.3, "{:?}", with.difference());
        let shadow = Pair { raster: with.raster, traced: without.raster };
        assert!(shadow.difference().color > 1.0, "there are shadows: {:?}", shadow.difference());
    }
}

#[test]
fn deformed_bodies_are_where_rays_meet_them() {
    let mut stage = Stage::new();
    let rest = sphere(DVec3::new(0.0, 0.0, 0.2), 0.06, 60);
    let (shape, _) = stage.add_mesh(&rest, 1, &Appearance::tissue([180, 80, 70])).unwrap();
    stage.lights = vec![Light::endoscope(&Pose::IDENTITY, 0.0025, 0.12)];
    let rays = RayGenerator::new(Camera::centred(160, 120, 1.2));
    for frame in 0..4 {
        let t = f64::from(frame);
        let bent: Vec<DVec3> =
            rest.vertices.iter().map(|p| *p + DVec3::new(0.03 * (40.0 * p.y + t).sin(), 0.01 * t, 0.0)).collect();
        stage.deform(shape, &bent).unwrap();
        let copy = stage.clone();
        let found = Pair::new(&mut stage, &rays, &Pose::IDENTITY, false, &Film::default()).difference();
        assert!(found.color < 0.1 && found.depth < 1e-5 && found.labels == 0.0, "{found:?}");
        // A copy shares shapes until one of the two deforms.
        let mut copy = copy;
        let before = render(&mut copy, &rays, &Pose::IDENTITY, &RenderSettings::preview(), &Film::default());
        stage.deform(shape, &rest.vertices).unwrap();
        let after = render(&mut copy, &rays, &Pose::IDENTITY, &RenderSettings::preview(), &Film::default());
        assert!(before == after);
    }
}

#[test]
fn eye_inside_of_a_closed_body_sees_its_inside() {
    let mut stage = Stage::new();
    stage.add_mesh(&sphere(DVec3::ZERO, 0.1, 30), 1, &Appearance::matte([200; 3])).unwrap();
    stage.lights = vec![Light::endoscope(&Pose::IDENTITY, 0.0025, 0.12)];
    for (name, model) in lenses() {
        let rays = RayGenerator::new(model);
        let found = Pair::new(&mut stage, &rays, &Pose::IDENTITY, false, &Film::default());
        assert!(found.raster.labels.iter().all(|l| *l == 1), "{name}");
        assert!(found.difference().depth < 1e-5, "{name}: {:?}", found.difference());
    }
}

#[test]
fn raster_does_not_depend_on_thread_count() {
    let picture = |threads: usize, settings: RenderSettings| {
        let mut stage = stage();
        stage.lights = vec![Light::endoscope(&Pose::IDENTITY, 0.03, 0.12)];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let rays = RayGenerator::new(Camera::centred(301, 207, 1.2));
        pool.install(|| render(&mut stage, &rays, &Pose::IDENTITY, &settings, &Film::endoscope()))
    };
    for settings in [RenderSettings::preview(), RenderSettings::Smooth] {
        let one = picture(1, settings);
        assert!(one == picture(2, settings) && one == picture(5, settings));
    }
}

/// What a stage keeps between pictures does not change them: bodies rest and move, deform, are lit
/// anew and seen through several cameras, and each picture has the bits of the first picture of a
/// copy, which keeps nothing.
#[test]
fn pictures_do_not_depend_on_earlier_ones() {
    earlier_pictures(false);
}

/// The same with a lamp that casts shadows, which bodies at rest keep and others change.
#[test]
fn shadows_do_not_depend_on_earlier_pictures() {
    earlier_pictures(true);
}

fn earlier_pictures(shadows: bool) {
    let mut stage = stage();
    let rest = sphere(DVec3::new(0.0, 0.0, 0.15), 0.03, 30);
    let (soft, _) = stage.add_mesh(&rest, 95, &Appearance::tissue([200, 80, 70])).unwrap();
    let (_, mover) = stage.add_mesh(&sphere(DVec3::ZERO, 0.01, 12), 96, &Appearance::steel()).unwrap();
    let (_, rarely) = stage.add_mesh(&sphere(DVec3::ZERO, 0.02, 12), 97, &Appearance::steel()).unwrap();
    // Two at the same depth, of which the first moves there: the order of drawing must not decide.
    let square = quad(DVec3::new(0.04, 0.04, 0.32), 0.2 * DVec3::X, 0.2 * DVec3::Y);
    let (_, patch) = stage.add_mesh(&square, 98, &Appearance::matte([20, 200, 20])).unwrap();
    stage.add_mesh(&square, 99, &Appearance::matte([200, 20, 20])).unwrap();
    let poses = poses();
    let lenses = lenses();
    let eyes = [(0, 0), (1, 1), (5, 3)].map(|(lens, pose): (usize, usize)| {
        let (lens, pose): (&(_, CameraModel), _) = (&lenses[lens], poses[pose]);
        (RayGenerator::new(lens.1).with_circular_image(1.1), pose)
    });
    let mut quick = Picture::default();
    for frame in 0..100_u32 {
        let t = f64::from(frame);
        let at = |x: f64, y: f64| Pose { translation: DVec3::new(x, y, 0.12), ..Pose::IDENTITY };
        if frame % 50 < 12 {
            stage.place(mover, &at(0.02 * t.sin(), 0.02 * t.cos())).unwrap();
        }
        if frame % 45 == 0 {
            stage.place(rarely, &at(0.04, -0.02 + 4e-4 * t)).unwrap();
        }
        if (5..9).contains(&frame) || frame == 80 {
            let bent: Vec<DVec3> =
                rest.vertices.iter().map(|p| *p + 0.01 * (60.0 * p.y + t).sin() * DVec3::X).collect();
            stage.deform(soft, &bent).unwrap();
        }
        if (20..60).contains(&frame) {
            let lift = DVec3::Z * if frame % 2 == 0 { 0.0 } else { 1e-3 };
            stage.place(patch, &Pose { translation: lift, ..Pose::IDENTITY }).unwrap();
        }
        stage.lights = vec![Light::endoscope(&eyes[0].1, 0.0025, if frame < 70 { 0.12 } else { 0.15 })];
        if shadows {
            let corner = DVec3::new(-0.5, 0.1, -0.9);
            stage.lights.push(Light::Panel { corner, along: DVec3::X, across: DVec3::Y, radiance: [6.0; 3] });
        }
        let noise = (frame % 7 == 3).then_some(Noise { shot: 0.015, read: 0.003, seed: 1, frame });
        let film = Film { noise, ..Film::endoscope() };
        let (rays, pose) = &eyes[if frame % 10 == 9 { 1 + usize::from(frame % 20 == 9) } else { 0 }];
        let settings = match frame % 9 {
            2 | 7 => RenderSettings::Smooth,
            kind => RenderSettings::Preview { shadows: shadows || kind == 4 },
        };
        render_into(&mut quick, &mut stage, rays, pose, &settings, &film);
        assert!(quick == render(&mut stage.clone(), rays, pose, &settings, &film), "frame {frame}");
        let expected = if frame >= 60 || (frame >= 20 && frame % 2 == 1) { 99 } else { 98 };
        let squares: Vec<&u16> = quick.labels.iter().filter(|l| [98, 99].contains(*l)).collect();
        assert!(squares.iter().all(|l| **l == expected), "frame {frame}");
        assert!(squares.len() > 100 || frame % 10 == 9, "frame {frame}: {}", squares.len());
    }
}
