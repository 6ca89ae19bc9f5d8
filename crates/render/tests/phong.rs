//! The simple renderer on shapes with known pictures.

mod common;

use common::sphere;
use glam::{DQuat, DVec3};
use trocar_camera::Camera;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::phong::{Instance, PhongImage, PhongScene, Shading, label_mask};

const PLAIN: Shading = Shading { color: [200, 120, 110], gloss: 0.3, wireframe: false };

/// A square of n x n cells spanned by `x` and `y`.
fn sheet(centre: DVec3, x: DVec3, y: DVec3, n: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    let at = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
    for j in 0..=n {
        for i in 0..=n {
            mesh.vertices.push(centre + x * at(i) + y * at(j));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            mesh.triangles.extend([[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]);
        }
    }
    mesh
}

fn instance(mesh: TriMesh, label: u16) -> Instance {
    Instance { mesh, label, shading: PLAIN }
}

fn brightness(frame: &PhongImage, u: usize, v: usize) -> u32 {
    frame.color.pixels[v * frame.color.width + u].iter().map(|c| u32::from(*c)).sum()
}

#[test]
fn sphere_has_the_right_depth_and_silhouette() {
    let camera = Camera::d405();
    let (z, radius) = (0.3, 0.05);
    let scene = PhongScene::new(vec![instance(sphere(DVec3::new(0.0, 0.0, z), radius, 200), 3)], None, [0; 3]);
    let frame = scene.render(&camera, &Pose::IDENTITY, 1);
    let centre = 240 * 848 + 424;
    assert!((f64::from(frame.depth.depth[centre]) - (z - radius)).abs() < 1e-5, "{}", frame.depth.depth[centre]);
    assert!(frame.facing[centre] > 0.999);
    // Silhouette of a sphere: the cone of half-angle asin(r / z).
    let expected = camera.fx * radius / (z * z - radius * radius).sqrt();
    let row = (0..848).filter(|u| frame.labels[240 * 848 + u] == 3).count();
    assert!((row as f64 / 2.0 - expected).abs() < 0.75, "{row} px across, radius {expected}");
    let area = label_mask(&frame, 3).count() as f64;
    let measured = (area / std::f64::consts::PI).sqrt();
    assert!((measured - expected).abs() < 0.1, "silhouette radius {measured} px, expected {expected}");
    assert!(frame.labels.iter().zip(&frame.depth.depth).all(|(l, d)| (*l == 0) == (*d == 0.0)));
}

#[test]
fn depth_of_a_tilted_plane_is_exact() {
    // An oblique pose, so that depth differs from ray length and from world z.
    let pose = Pose {
        rotation: DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(0.3),
        translation: DVec3::new(0.1, -0.2, 0.05),
    };
    let (x, y) = (DVec3::new(1.0, 0.0, 0.25).normalize(), DVec3::new(0.0, 1.0, -0.4).normalize());
    let plane_centre = pose.transform(DVec3::new(0.01, 0.02, 0.3));
    let (wx, wy) = (pose.rotation * x, pose.rotation * y);
    let mut camera = Camera::d405();
    camera.distortion = trocar_camera::Distortion([0.05, -0.02, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0]);
    let scene = PhongScene::new(vec![instance(sheet(plane_centre, wx, wy, 40), 1)], None, [0; 3]);
    let frame = scene.render(&camera, &pose, 1);
    let normal = x.cross(y).normalize();
    let offset = normal.dot(DVec3::new(0.01, 0.02, 0.3));
    for (i, depth) in frame.depth.depth.iter().enumerate() {
        let ray = camera.ray((i % 848) as f64, (i / 848) as f64);
        let truth = offset / normal.dot(ray);
        assert!((f64::from(*depth) - truth).abs() < 1e-6, "pixel {i}: {depth} against {truth}");
        let facing = normal.dot(ray.normalize()).abs();
        assert!((f64::from(frame.facing[i]) - facing).abs() < 1e-5);
    }
}

#[test]
fn label_is_that_of_the_nearer_instance() {
    let ball = |x: f64, z: f64, label| instance(sphere(DVec3::new(x, 0.0, z), 0.04, 40), label);
    let scene = PhongScene::new(vec![ball(0.0, 0.3, 1), ball(0.02, 0.25, 2)], None, [9; 3]);
    let frame = scene.render(&Camera::d405(), &Pose::IDENTITY, 1);
    assert_eq!(frame.labels[240 * 848 + 424], 2);
    assert_eq!(frame.labels[240 * 848 + 370], 1, "the farther ball's rim shows");
    assert_eq!(frame.labels[0], 0);
    assert_eq!(frame.color.pixels[0], [9; 3], "the background shows where nothing is");
}

#[test]
fn no_ray_passes_between_triangles() {
    // Grid lines fall exactly on pixel centres.
    let mut camera = Camera::d405();
    (camera.cx, camera.cy, camera.fx, camera.fy) = (424.0, 240.0, 400.0, 400.0);
    let scene = PhongScene::new(vec![instance(sheet(DVec3::Z, 2.0 * DVec3::X, 2.0 * DVec3::Y, 160), 1)], None, [0; 3]);
    let frame = scene.render(&camera, &Pose::IDENTITY, 1);
    assert_eq!(label_mask(&frame, 1).count(), 848 * 480);
}

#[test]
fn image_does_not_depend_on_thread_count() {
    let scene = || {
        let ball = instance(sphere(DVec3::new(0.01, 0.0, 0.3), 0.05, 60), 1);
        let floor = instance(sheet(DVec3::new(0.0, 0.0, 0.35), DVec3::X, DVec3::Y, 30), 2);
        let scene = PhongScene::new(vec![ball, floor], Some(DVec3::new(0.5, -0.2, -1.0)), [0; 3]);
        scene.with_ambient_occlusion(8, 0.02).render(&Camera::d405(), &Pose::IDENTITY, 2)
    };
    let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(scene);
    let (one, two) = (on(1), on(2));
    assert_eq!(one.color, two.color);
    assert_eq!(one.depth, two.depth);
    assert_eq!(one.labels, two.labels);
    assert_eq!(one.facing, two.facing);
}

#[test]
fn wireframe_darkens_only_edges() {
    let picture = |wireframe| {
        let mesh = sheet(DVec3::new(0.0, 0.0, 0.3), 0.2 * DVec3::X, 0.2 * DVec3::Y, 8);
        let shading = Shading { wireframe, ..PLAIN };
        PhongScene::new(vec![Instance { mesh, label: 1, shading }], None, [0; 3]).render(
            &Camera::d405(),
            &Pose::IDENTITY,
            3,
        )
    };
    let (with, without) = (picture(true), picture(false));
    let camera = Camera::d405();
    // A grid line runs along x = 0; cells are 0.05 wide with a diagonal.
    let pixel = |x: f64, y: f64| camera.project(DVec3::new(x, y, 0.3)).unwrap();
    let edge = pixel(0.0, 0.02);
    let inside = pixel(0.015, 0.012);
    let at = |frame: &PhongImage, p: glam::DVec2| brightness(frame, p.x.round() as usize, p.y.round() as usize);
    assert!(at(&with, edge) * 10 < at(&without, edge) * 9, "{} against {}", at(&with, edge), at(&without, edge));
    assert_eq!(at(&with, inside), at(&without, inside));
    let darker = (0..848 * 480).filter(|i| with.color.pixels[*i] != without.color.pixels[*i]).count();
    let share = darker as f64 / label_mask(&with, 1).count() as f64;
    assert!(share < 0.15, "lines cover {share} of the sheet");
}

#[test]
fn side_light_casts_a_shadow() {
    let ball = instance(sphere(DVec3::new(0.0, 0.0, 0.25), 0.02, 40), 1);
    let floor = instance(sheet(DVec3::new(0.0, 0.0, 0.3), DVec3::X, DVec3::Y, 4), 2);
    let light = DVec3::new(1.0, 0.0, -1.0);
    let frame = PhongScene::new(vec![ball, floor], Some(light), [0; 3]).render(&Camera::d405(), &Pose::IDENTITY, 1);
    let pixel = |x: f64| Camera::d405().project(DVec3::new(x, 0.0, 0.3)).unwrap().x.round() as usize;
    // The centre of the shadow is where the light's ray through the ball's centre meets the floor.
    assert!(brightness(&frame, pixel(-0.05), 240) * 3 < brightness(&frame, pixel(0.05), 240) * 2);
}

#[test]
fn ambient_occlusion_darkens_creases() {
    let floor = sheet(DVec3::new(0.0, 0.0, 0.3), 0.1 * DVec3::Y, 0.1 * DVec3::X, 100);
    let wall = sheet(DVec3::new(0.0, 0.0, 0.28), 0.1 * DVec3::Y, -0.02 * DVec3::Z, 40);
    let matte = |mesh| Instance { mesh, label: 1, shading: Shading { gloss: 0.0, ..PLAIN } };
    let meshes = vec![matte(floor), matte(wall)];
    let frame = PhongScene::new(meshes, None, [0; 3]).with_ambient_occlusion(32, 0.02).render(
        &Camera::d405(),
        &Pose::IDENTITY,
        1,
    );
    let at = |x: f64| {
        let p = Camera::d405().project(DVec3::new(x, 0.0, 0.3)).unwrap();
        brightness(&frame, p.x.round() as usize, p.y.round() as usize)
    };
    assert!(at(0.003) * 10 < at(0.05) * 9, "{} by the wall, {} away", at(0.003), at(0.05));
}

#[test]
fn empty_and_invalid_meshes_are_invisible() {
    let mut broken = sphere(DVec3::Z, 0.1, 8);
    broken.vertices[0] = DVec3::NAN;
    broken.triangles = vec![[0, 1, 2], [3, 4, 99_999]];
    for instances in [vec![], vec![instance(broken, 1)]] {
        let frame = PhongScene::new(instances, None, [7; 3]).render(&Camera::d405(), &Pose::IDENTITY, 2);
        assert!(frame.color.pixels.iter().all(|p| *p == [7; 3]));
    }
}

/// Measures the speed: `cargo test --release -p trocar-render -- --ignored --nocapture speed`.
#[test]
#[ignore = "a measurement"]
fn speed() {
    let scene = PhongScene::new(
        vec![
            instance(sphere(DVec3::new(0.0, 0.0, 0.25), 0.06, 150), 1),
            instance(sheet(DVec3::new(0.0, 0.0, 0.3), DVec3::X, DVec3::Y, 200), 2),
        ],
        None,
        [0; 3],
    );
    let camera = Camera::d405();
    let start = std::time::Instant::now();
    let frame = scene.render(&camera, &Pose::IDENTITY, 2);
    let seconds = start.elapsed().as_secs_f64();
    println!("{:.2} Mrays/s, {} lit", 5.0 * 848.0 * 480.0 / seconds / 1e6, label_mask(&frame, 1).count());
}

/// Through a lens with distortion the tracer finds the hits. What is drawn without is the same.
#[test]
fn drawn_triangles_are_those_that_rays_hit() {
    let ball = instance(sphere(DVec3::new(0.01, 0.0, 0.3), 0.05, 60), 1);
    let floor = instance(sheet(DVec3::new(0.0, 0.0, 0.35), DVec3::X, DVec3::Y, 30), 2);
    // Partly behind the camera, and wholly.
    let wall = instance(sheet(DVec3::new(0.08, 0.0, 0.1), DVec3::Z, DVec3::Y, 3), 3);
    let behind = instance(sheet(DVec3::new(0.0, 0.0, -0.2), DVec3::X, DVec3::Y, 3), 4);
    // At the place of a part of the floor: equally near.
    let twin = instance(sheet(DVec3::new(0.0, 0.0, 0.35), DVec3::X, DVec3::Y, 30), 5);
    let scene = PhongScene::new(vec![ball, floor, wall, behind, twin], Some(DVec3::new(0.5, -0.2, -1.0)), [0; 3]);
    let pose = Pose { rotation: DQuat::from_rotation_y(0.1), translation: DVec3::new(0.01, -0.02, 0.03) };
    for samples in [1, 3] {
        let mut camera = Camera::centred(160, 96, 1.4);
        let drawn = scene.render(&camera, &pose, samples);
        camera.distortion = trocar_camera::Distortion([1e-300, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(!camera.distortion.is_none());
        let traced = scene.render(&camera, &pose, samples);
        let shows = |label| drawn.labels.contains(&label);
        assert!(shows(1) && (shows(2) || shows(5)) && shows(3) && !shows(4), "what is before the camera shows");
        assert_eq!(drawn.labels, traced.labels);
        assert_eq!(drawn.depth, traced.depth);
        assert_eq!(drawn.facing, traced.facing);
        assert_eq!(drawn.color, traced.color);
    }
}
