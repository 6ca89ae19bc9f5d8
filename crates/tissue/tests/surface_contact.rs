//! Contact of the whole surface with round tools: what is thinner than a triangle is wide does not
//! pass between its vertices.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, Collider, Hole, Material, Model, ModelBuilder, Shape, SolverSettings, State, Stepper, ToolContact,
    ToolMotion,
};

/// The smallest instrument's half width (m).
const RADIUS: f64 = 1.6e-3;

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

/// A block of triangles of 6 mm on its ground, and a capsule.
fn scene(young_modulus: f64, ends: [DVec3; 2], friction: f64, contact: ToolContact) -> (Model, TetMesh) {
    let mesh = block([6, 6, 3], 6e-3);
    let mut builder = ModelBuilder::new().gravity(GRAVITY).tool_contact(contact);
    let material = Material { viscosity: young_modulus * 5e-3, ..tissue(young_modulus) };
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "tissue".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let shape = Shape::Capsule { ends, radius: RADIUS };
    builder.collider(Collider { name: "tool".into(), tool: 0, shape, rest_offset: 0.0, friction }).unwrap();
    (builder.build().unwrap(), mesh)
}

/// Distance of the axis from the surface, by points (m); negative if it is inside.
fn clearance(model: &Model, state: &State, [a, b]: [DVec3; 2], skin: &[[u32; 3]]) -> f64 {
    let x = state.positions(model, 0);
    let mut least = f64::INFINITY;
    for t in skin {
        let [p, q, r] = t.map(|i| x[i as usize]);
        let normal = (q - p).cross(r - p).normalize();
        for (u, v) in (0..=20).flat_map(|u| (0..=20 - u).map(move |v| (f64::from(u) / 20.0, f64::from(v) / 20.0))) {
            let place = p + u * (q - p) + v * (r - p);
            let share = ((place - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            let off = a + share * (b - a) - place;
            let distance = off.length().copysign(if off.length() < 3e-3 { off.dot(normal) } else { 1.0 });
            least = least.min(distance);
        }
    }
    least
}

/// Presses the capsule 4 mm into the top of the block, from 1 mm above it: the least clearance of
/// its axis, and the force at the end (N).
fn press(
    contact: ToolContact,
    young_modulus: f64,
    schedule: SolverSettings,
    ends: [DVec3; 2],
    speed: f64,
) -> (f64, f64) {
    let (model, mesh) = scene(young_modulus, ends, 0.3, contact);
    let top = 18e-3;
    let (boundary, of) = mesh.boundary();
    let skin: Vec<[u32; 3]> = boundary.triangles.iter().map(|t| t.map(|i| of[i as usize])).collect();
    let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, schedule, FRAME, 1).unwrap());
    let low = ends.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let mut z = top + RADIUS + 1e-3 - low;
    let end = top + RADIUS - 4e-3 - low;
    let (mut least, mut fallbacks, mut iterations) = (f64::INFINITY, 0, 0);
    let mut rest = 20;
    while rest > 0 {
        let to = (z - speed * FRAME).max(end);
        rest -= usize::from(to == z);
        let motion = ToolMotion { from: at(DVec3::Z * z), to: at(DVec3::Z * to) };
        let report = stepper.step(&model, &mut state, &[motion]);
        assert_eq!((report.inverted, report.divergence), (0, None));
        (fallbacks, iterations) = (fallbacks + report.fallbacks, iterations + report.iterations);
        z = to;
        least = least.min(clearance(&model, &state, ends.map(|p| p + DVec3::Z * z), &skin));
    }
    let force = stepper.forces()[0].contact.force.z;
    println!(
        "{contact:?}, {young_modulus} Pa, {speed} m/s: overlap {:.3} mm, {force:.4} N, {fallbacks} fallbacks, {iterations} iterations",
        1e3 * (RADIUS - least)
    );
    (least, force)
}

/// A bar along the surface, between the vertices; and a rod whose end points at a triangle.
fn bar() -> [DVec3; 2] {
    [DVec3::new(0.0156, 0.0131, 0.0), DVec3::new(0.0153, 0.0229, 0.0)]
}

fn rod() -> [DVec3; 2] {
    [DVec3::new(0.0161, 0.0141, 0.0), DVec3::new(0.0181, 0.0151, 0.03)]
}

#[test]
fn a_thin_tool_does_not_pass_between_the_vertices() {
    for ends in [bar(), rod()] {
        let (through, _) = press(ToolContact::Vertices, 12e3, SolverSettings::FAST, ends, 0.02);
        assert!(through < -1e-3, "vertices alone stop it: {through} m");
        for young_modulus in [0.5e3, 12e3, 1e6] {
            let (least, force) = press(ToolContact::Surface, young_modulus, SolverSettings::FAST, ends, 0.02);
            assert!(RADIUS - least < 0.3e-3, "{young_modulus} Pa: {least} m from the axis");
            assert!(force > 0.0);
        }
        let (fast, _) = press(ToolContact::Surface, 12e3, SolverSettings::FAST, ends, 0.5);
        assert!(fast > 0.0, "at 0.5 m/s: {fast} m from the axis");
        let (swept, _) = press(ToolContact::Surface, 12e3, SolverSettings::PAPER, ends, 0.02);
        assert!(swept > 0.0, "by sweeps: {swept} m from the axis");
    }
}

/// What is pushed aside by friction at an edge stays there, and holds up to its limit.
#[test]
fn friction_acts_between_the_vertices_too() {
    let drag = |friction: f64| {
        let (model, _) = scene(12e3, rod(), friction, ToolContact::Surface);
        let (mut state, mut stepper) =
            (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
        let mut pose = DVec3::Z * (18e-3 + RADIUS + 0.2e-3);
        let mut go = |by: DVec3, frames: usize| {
            for _ in 0..frames {
                let from = pose;
                pose += by / frames as f64;
                stepper.step(&model, &mut state, &[ToolMotion { from: at(from), to: at(pose) }]);
            }
            stepper.forces()[0]
        };
        go(DVec3::Z * -2e-3, 30);
        let before = go(DVec3::ZERO, 20);
        let held = go(DVec3::X * 0.3e-3, 30);
        (before.contact.force, held.contact.force - before.contact.force, held.pressing)
    };
    let (_, free, _) = drag(0.0);
    let (_, held, _) = drag(0.6);
    let (_, slips, pressing) = drag(0.02);
    println!("{free} N free, {held} N held, {slips} N slipping at {pressing} N");
    let (held, slips) = (free.x - held.x, free.x - slips.x);
    assert!(held > 0.04 && held < 0.6 * pressing, "tissue is carried along: {held} N");
    assert!(slips > 0.0 && slips < 1.02 * 0.02 * pressing, "up to a limit: {slips} of {pressing} N");
}

/// The motion of the tool that is pressed into the block, in a frame.
fn pressing(frame: i32) -> [ToolMotion; 1] {
    let place = |k: i32| at(DVec3::new(1e-5 * f64::from(k), 0.0, 20e-3 - 1e-4 * f64::from(k)));
    [ToolMotion { from: place(frame), to: place(frame + 1) }]
}

/// The same bits for any number of threads, and when continued from the middle: in a new stepper,
/// or in the one that went on.
#[test]
fn it_repeats_to_the_bit() {
    #[derive(PartialEq)]
    enum Again {
        Never,
        New,
        Restored,
    }
    let run = |threads: usize, again: Again| {
        let (model, _) = scene(12e3, bar(), 0.4, ToolContact::Surface);
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, threads).unwrap();
        for frame in 0..40 {
            if frame == 20 && again == Again::New {
                state = state.clone();
                stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, threads).unwrap();
            }
            if frame == 20 && again == Again::Restored {
                let mut later = state.clone();
                (20..60)
                    .for_each(|frame| assert!(stepper.step(&model, &mut later, &pressing(frame)).divergence.is_none()));
                assert_ne!(later.hash(), state.hash());
            }
            stepper.step(&model, &mut state, &pressing(frame));
        }
        state.hash()
    };
    let alone = run(1, Again::Never);
    assert_eq!(alone, run(2, Again::Never));
    assert_eq!(alone, run(1, Again::New));
    assert_eq!(alone, run(1, Again::Restored));
}

/// A stepper of one model serves another one with the other kind of contact: nothing of the first
/// is left.
#[test]
fn a_stepper_serves_both_kinds_of_contact() {
    let [surface, vertices] =
        [ToolContact::Surface, ToolContact::Vertices].map(|contact| scene(12e3, bar(), 0.4, contact).0);
    let press = |stepper: &mut Stepper, model: &Model| {
        let mut state = State::new(model);
        (0..40).for_each(|frame| assert_eq!(stepper.step(model, &mut state, &pressing(frame)).divergence, None));
        state.hash()
    };
    let new = |model| Stepper::new(model, SolverSettings::FAST, FRAME, 1).unwrap();
    let mut stepper = new(&surface);
    let [of_surface, of_vertices] = [&surface, &vertices].map(|model| press(&mut stepper, model));
    assert_ne!(of_surface, of_vertices);
    assert_eq!(of_vertices, press(&mut new(&vertices), &vertices));
}

/// Force of the block on two equal rods that come 1 mm into its top, 18 mm apart (N), when the
/// first is in a hole.
fn forces_at_a_hole(schedule: SolverSettings, hole: bool) -> [f64; 2] {
    let mesh = block([6, 6, 3], 6e-3);
    let mut builder = ModelBuilder::new().gravity(GRAVITY).tool_contact(ToolContact::Surface);
    let material = Material { viscosity: 60.0, ..tissue(12e3) };
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "tissue".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let places = [9e-3, 27e-3].map(|x| DVec3::new(x, 18e-3, 18e-3 + RADIUS - 1e-3));
    for (tool, place) in places.iter().enumerate() {
        let shape = Shape::Capsule { ends: [DVec3::ZERO, 5e-3 * DVec3::Z], radius: RADIUS };
        builder.collider(Collider { name: "rod".into(), tool, shape, rest_offset: 0.0, friction: 0.3 }).unwrap();
        assert!(mesh.vertices.iter().any(|p| p.distance(*place) < 8e-3), "there is tissue at {place}");
    }
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    if hole {
        let nodes = nodes(&mesh, |p| p.distance(places[0]) < 9e-3);
        state.holes.push(Hole { body: 0, tools: vec![0], nodes });
    }
    let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
    let motions = places.map(|place| ToolMotion { from: at(place), to: at(place) });
    for _ in 0..20 {
        assert_eq!(stepper.step(&model, &mut state, &motions).divergence, None);
    }
    let all = stepper.forces().iter().map(|force| force.contact.force.length()).collect::<Vec<_>>();
    assert_eq!(stepper.force_of(0, 1), stepper.forces()[1]);
    assert_eq!(state.holes.len(), usize::from(hole));
    [all[0], all[1]]
}

#[test]
fn a_hole_lets_its_tool_through_and_no_other() {
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let [one, other] = forces_at_a_hole(schedule, false);
        assert!(one > 0.01 && other > 0.01, "{one} N, {other} N");
        let [through, beside] = forces_at_a_hole(schedule, true);
        println!("{one:.3} N and {other:.3} N; with a hole {through} N and {beside:.3} N");
        assert!(through == 0.0 && (beside / other - 1.0).abs() < 0.1, "{through} N, {beside} N");
    }
}
