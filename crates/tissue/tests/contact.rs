//! Contact with tools and supports: Hertz, Coulomb, nothing creeps, nothing is passed through,
//! whatever the speed and the stiffness.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, Collider, Material, Model, ModelBuilder, Shape, SolverSettings, State, Stepper, Support,
    SupportPlane, ToolMotion,
};

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

fn still(pose: Pose) -> ToolMotion {
    ToolMotion { from: pose, to: pose }
}

fn collider(shape: Shape, rest_offset: f64, friction: f64) -> Collider {
    Collider { name: "tool".into(), tool: 0, shape, rest_offset, friction }
}

fn scene(
    mesh: &TetMesh,
    material: Material,
    pinned: Vec<u32>,
    supports: Vec<Support>,
    colliders: Vec<Collider>,
    gravity: DVec3,
) -> Model {
    let mut builder = ModelBuilder::new().gravity(gravity);
    builder.body(BodyDescription { name: "tissue".into(), mesh, material, pinned, supports }).unwrap();
    for collider in colliders {
        builder.collider(collider).unwrap();
    }
    builder.build().unwrap()
}

fn centroid(model: &Model, state: &State) -> DVec3 {
    let x = state.positions(model, 0);
    x.iter().sum::<DVec3>() / x.len() as f64
}

/// A rigid sphere pressed into soft tissue: Hertz's force, with what a layer of finite thickness
/// bonded to its ground adds (Dimitriadis and others 2002, Determination of elastic moduli of thin
/// layers of soft material using the atomic force microscope, equation 3).
#[test]
fn a_sphere_is_pushed_back_as_hertz_says() {
    // Finer towards the place of contact.
    let (half, steep, n) = (0.04, 3.0f64, 10);
    let mut mesh = block([2 * n, 2 * n, n + 3], 1.0);
    let graded = |u: f64| half * u.signum() * ((steep * u.abs()).exp() - 1.0) / (steep.exp() - 1.0);
    let middle = n as f64;
    for p in &mut mesh.vertices {
        *p = DVec3::new(graded(p.x / middle - 1.0), graded(p.y / middle - 1.0), graded(p.z / (middle + 3.0) - 1.0));
    }
    // Linear tetrahedra of nearly incompressible tissue are too stiff where they are long and thin:
    // that is not what is tested.
    let nu: f64 = 0.3;
    let material = Material { viscosity: 40.0, poisson_ratio: nu, ..tissue(12e3) };
    let pinned = nodes(&mesh, |p| p.z < -0.99 * half);
    let radius: f64 = 0.03;
    let sphere = collider(Shape::Sphere { centre: DVec3::ZERO, radius }, 0.0, 0.0);
    let model = scene(&mesh, material, pinned, vec![], vec![sphere], DVec3::ZERO);
    let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
    for depth in [0.3e-3, 0.6e-3] {
        for _ in 0..60 {
            let report = stepper.step(&model, &mut state, &[still(at(DVec3::Z * (radius - depth)))]);
            assert_eq!((report.fallbacks, report.inverted), (0, 0));
        }
        let force = stepper.forces()[0].contact.force;
        let hertz = 4.0 / 3.0 * 12e3 / (1.0 - nu * nu) * radius.sqrt() * depth.powf(1.5);
        let (thin, bonded) = (
            (radius * depth).sqrt() / half,
            2.0 / std::f64::consts::PI * (1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu),
        );
        let expected = hertz * (1.0 + bonded * thin + (bonded * thin).powi(2));
        println!("pressed {:.1} mm: {:.4} N, Hertz {hertz:.4} N, on the ground {expected:.4} N", depth * 1e3, force.z);
        assert!((force.z / expected - 1.0).abs() < 0.1, "{force} N, {expected} N");
        assert!(force.truncate().length() < 0.02 * force.z, "{force} N");
    }
}

/// A block on an incline stays where it is below the angle of friction, for a minute and to the
/// micrometre, and slides as it should above.
#[test]
fn a_block_on_an_incline_sticks_and_slides_at_the_right_angle() {
    let mesh = block([4, 4, 2], 3e-3);
    let friction: f64 = 0.5;
    let material = Material { viscosity: 60.0, ..tissue(12e3) };
    let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction };
    let table = collider(Shape::HalfSpace { point: DVec3::ZERO, normal: DVec3::Z }, 0.0, friction);
    for (supports, colliders) in [(vec![plane.into()], vec![]), (vec![], vec![table])] {
        for share in [0.95, 1.05] {
            let angle = (share * friction).atan();
            let gravity = 9.81 * DVec3::new(angle.sin(), 0.0, -angle.cos());
            let model = scene(&mesh, material, vec![], supports.clone(), colliders.clone(), gravity);
            let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
            let mut state = State::new(&model);
            let mut walk = |frames: usize| {
                for _ in 0..frames {
                    let report = stepper.step(&model, &mut state, &[still(Pose::IDENTITY)]);
                    assert_eq!((report.fallbacks, report.inverted), (0, 0));
                }
                centroid(&model, &state).x
            };
            let (first, next) = (walk(60), walk(60));
            let accelerated = 9.81 * (angle.sin() - friction * angle.cos());
            println!("at {share} of the angle of friction: {:.4} mm in the second second", (next - first) * 1e3);
            if share < 1.0 {
                let last = walk(if colliders.is_empty() { 600 } else { 3600 });
                println!("and {:.6} mm afterwards", (last - next) * 1e3);
                assert!((last - next).abs() < 1e-6, "creeps by {} m", last - next);
            } else {
                // From rest: s(2) - s(1) = 3/2 a t^2.
                let expected = 1.5 * accelerated;
                assert!(((next - first) / expected - 1.0).abs() < 0.1, "slid {}, {expected} m", next - first);
            }
        }
    }
}

/// A bar at half a metre a second through a column: the column gives way, no point of it is ever
/// inside the bar, and it comes back.
#[test]
fn nothing_is_passed_through_at_half_a_metre_a_second() {
    let mesh = block([4, 4, 10], 2e-3);
    let material = Material { viscosity: 60.0, ..tissue(12e3) };
    let radius = 2e-3;
    let ends = [DVec3::new(0.0, -0.02, 0.012), DVec3::new(0.0, 0.03, 0.012)];
    for (schedule, speed) in [(SolverSettings::FAST, 0.5), (SolverSettings::FAST, 0.1), (SolverSettings::PAPER, 0.5)] {
        let bar = collider(Shape::Capsule { ends, radius }, 1.5e-3, 0.3);
        let model = scene(&mesh, material, nodes(&mesh, |p| p.z == 0.0), vec![], vec![bar], DVec3::ZERO);
        let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, schedule, FRAME, 1).unwrap());
        let (mut place, mut nearest, mut lean) = (-0.02, f64::INFINITY, 0.0f64);
        let mut fallbacks = 0;
        while place < 0.07 {
            let to = place + speed * FRAME;
            let motion = ToolMotion { from: at(DVec3::X * place), to: at(DVec3::X * to) };
            let report = stepper.step(&model, &mut state, &[motion]);
            assert_eq!((report.inverted, report.divergence), (0, None), "{schedule:?} at {place} m");
            fallbacks += report.fallbacks;
            place = to;
            for p in state.positions(&model, 0) {
                let off = DVec3::new(p.x - place, 0.0, p.z - 0.012);
                nearest = nearest.min(off.length() - radius);
                lean = lean.max(p.x - 8e-3);
            }
        }
        println!(
            "{:?} at {speed} m/s: never nearer than {:.3} mm, leans {:.1} mm, {fallbacks} fallbacks",
            schedule.substeps(),
            nearest * 1e3,
            lean * 1e3
        );
        assert!(nearest > 0.0, "{schedule:?}: {nearest} m inside the bar");
        assert!(lean > 5e-3, "nothing was pushed: {lean}");
        for _ in 0..240 {
            stepper.step(&model, &mut state, &[still(at(DVec3::X * place))]);
        }
        let off =
            state.positions(&model, 0).iter().zip(&mesh.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-3 || schedule == SolverSettings::PAPER, "{schedule:?}: still {off} m off");
    }
}

/// A capsule pressed deep into tissue that is pinned right below: no blow-up, no inverted element,
/// and a force that only grows.
#[test]
fn a_capsule_pressed_into_pinned_tissue_is_held_back() {
    let mesh = block([12, 8, 4], 2e-3);
    let material = Material { viscosity: 60.0, ..tissue(12e3) };
    let ends = [DVec3::new(0.008, 0.008, 0.0), DVec3::new(0.016, 0.008, 0.0)];
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let tool = collider(Shape::Capsule { ends, radius: 2.5e-3 }, 1.5e-3, 0.6);
        let pinned = nodes(&mesh, |p| p.z < 3e-3);
        let model = scene(&mesh, material, pinned, vec![], vec![tool], GRAVITY);
        let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, schedule, FRAME, 1).unwrap());
        let (mut height, mut last, mut fallbacks) = (0.0125, 0.0, 0);
        for frame in 0..90 {
            let to: f64 = height - 5e-3 / 60.0;
            let motion = ToolMotion { from: at(DVec3::Z * height), to: at(DVec3::Z * to) };
            let report = stepper.step(&model, &mut state, &[motion]);
            assert_eq!((report.inverted, report.divergence), (0, None), "{schedule:?} {frame}");
            assert!(report.max_speed < 0.5, "{schedule:?}: {} m/s", report.max_speed);
            fallbacks += report.fallbacks;
            height = to;
            if frame % 15 == 14 {
                let force = stepper.forces()[0].contact.force.z;
                println!("{} substeps: {:.1} mm up: {force:.3} N", schedule.substeps(), height * 1e3);
                assert!(force > last, "{force} N after {last} N");
                last = force;
            }
        }
        println!("{fallbacks} fallbacks");
    }
}

/// Touching and letting go every few frames at contact stiffnesses from 20 to 50,000 N/m a node.
#[test]
fn contact_holds_at_any_stiffness() {
    let mesh = block([6, 6, 3], 2e-3);
    for stiffness in [20.0, 240.0, 5e3, 5e4] {
        let material = Material { viscosity: 60.0, ..tissue(12e3) };
        let mut builder = ModelBuilder::new().gravity(GRAVITY).contact_stiffness(stiffness / (12e3 * 2e-3));
        let pinned = nodes(&mesh, |p| p.z == 0.0);
        builder
            .body(BodyDescription { name: "tissue".into(), mesh: &mesh, material, pinned, supports: vec![] })
            .unwrap();
        builder.collider(collider(Shape::Sphere { centre: DVec3::ZERO, radius: 4e-3 }, 1.5e-3, 0.6)).unwrap();
        let model = builder.build().unwrap();
        let (mut state, mut stepper) =
            (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
        let height = |frame: usize| 0.0115 + 1.2e-3 * (frame as f64 * 0.7).cos() - 1.0e-3;
        let (mut iterations, mut fallbacks, mut fastest) = (0, 0, 0.0f64);
        for frame in 0..180 {
            let place = |f| at(DVec3::new(0.006 + 1e-5 * f as f64, 0.006, height(f)));
            let motion = ToolMotion { from: place(frame), to: place(frame + 1) };
            let report = stepper.step(&model, &mut state, &[motion]);
            assert_eq!((report.inverted, report.divergence), (0, None));
            iterations += report.iterations;
            fallbacks += report.fallbacks;
            fastest = fastest.max(report.max_speed);
        }
        println!(
            "{stiffness} N/m: {:.1} iterations a frame, {fallbacks} fallbacks, {fastest:.2} m/s",
            iterations as f64 / 180.0
        );
        assert!(
            fastest < if stiffness > 1e4 { 0.5 } else { 0.2 } && fallbacks < 10,
            "{stiffness} N/m: {fallbacks} fallbacks, {fastest} m/s"
        );
    }
}

/// Contact is the same for any number of threads, when run again, and when continued from the
/// middle.
#[test]
fn contact_repeats_to_the_bit() {
    let mesh = block([6, 4, 3], 2e-3);
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    for k in 0..3 {
        let mut mesh = mesh.clone();
        mesh.vertices.iter_mut().for_each(|p| p.y += 0.02 * f64::from(k));
        let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction: 0.6 };
        let material = Material { viscosity: 60.0, ..tissue(12e3) };
        let (name, supports) = (format!("{k}"), vec![plane.into()]);
        builder.body(BodyDescription { name, mesh: &mesh, material, pinned: vec![], supports }).unwrap();
    }
    let ends = [DVec3::Y * -0.01, DVec3::Y * 0.06];
    builder.collider(collider(Shape::Capsule { ends, radius: 2e-3 }, 1e-3, 0.5)).unwrap();
    let model = builder.build().unwrap();
    let place = |f: usize| {
        let f = f as f64;
        let rotation = DQuat::from_rotation_x(0.05 * (0.1 * f).sin());
        Pose { rotation, translation: DVec3::new(4e-4 * f - 0.005, 0.0, 7e-3 + 2e-3 * (0.2 * f).cos()) }
    };
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let mut hashes = Vec::new();
        for (threads, pause) in [(1, 0), (2, 0), (3, 0), (1, 37)] {
            let (mut state, mut stepper) =
                (State::new(&model), Stepper::new(&model, schedule, FRAME, threads).unwrap());
            for frame in 0..90 {
                if pause > 0 && frame == pause {
                    let saved = state.clone();
                    stepper.step(&model, &mut state, &[]);
                    state = saved;
                    stepper = Stepper::new(&model, schedule, FRAME, threads).unwrap();
                }
                let motion = ToolMotion { from: place(frame), to: place(frame + 1) };
                stepper.step(&model, &mut state, &[motion]);
            }
            hashes.push(state.hash());
        }
        assert!(hashes.iter().all(|h| *h == hashes[0]), "{schedule:?}: {hashes:x?}");
    }
}
