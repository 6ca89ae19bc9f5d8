//! The contract of a tissue backend: the same suite for each of them, with bodies that touch with
//! the boundary of their elements, and with ones that have a finer collision surface. A new backend
//! is a line in [`backends`].

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, refined, tissue};
use trocar_tissue::{
    Backend, BodyContact, BodyDescription, Collider, Compliance, Cut, Grasp, LatticeSettings, Law, Material, Model,
    ModelBuilder, Shape, SolverSettings, State, Stepper, SupportPlane, ToolContact, ToolMotion, sever,
};

/// What the suite runs on.
#[derive(Clone, Copy)]
struct Case {
    backend: Backend,
    /// Whether bodies have a collision surface of their own, in triangles of a quarter.
    fine: bool,
}

impl Case {
    fn add(self, builder: &mut ModelBuilder, body: BodyDescription<'_>) -> trocar_tissue::Result<()> {
        let mesh = body.mesh;
        let index = builder.body(body)?;
        if self.fine { builder.collision_surface(index, &refined(&mesh.boundary().0)) } else { Ok(()) }
    }
}

/// Every backend, with its name.
fn backends() -> [(&'static str, Case); 5] {
    let lattice = |law| Backend::Lattice(LatticeSettings { cell: 3e-3, law });
    let of = |backend| Case { backend, fine: false };
    let fine = |backend| Case { backend, fine: true };
    [
        ("tetrahedra", of(Backend::Tetrahedra)),
        ("corotated lattice", of(lattice(Law::Corotated))),
        ("neo-Hookean lattice", of(lattice(Law::StableNeoHookean))),
        ("tetrahedra, fine surface", fine(Backend::Tetrahedra)),
        ("neo-Hookean lattice, fine surface", fine(lattice(Law::StableNeoHookean))),
    ]
}

/// Bodies under gravity.
struct Scene<'a> {
    builder: ModelBuilder,
    case: Case,
    mesh: &'a TetMesh,
}

impl<'a> Scene<'a> {
    fn new(case: Case, mesh: &'a TetMesh) -> Self {
        Self { builder: ModelBuilder::new().gravity(GRAVITY).backend(case.backend), case, mesh }
    }

    fn body(mut self, material: Material, pinned: Vec<u32>, supports: Vec<SupportPlane>) -> Self {
        let supports = supports.into_iter().map(Into::into).collect();
        let (name, mesh) = ("body".to_owned(), self.mesh);
        self.case.add(&mut self.builder, BodyDescription { name, mesh, material, pinned, supports }).unwrap();
        self
    }

    fn build(self) -> Model {
        self.builder.build().unwrap()
    }
}

fn viscous(young_modulus: f64) -> Material {
    Material { viscosity: 0.006 * young_modulus, ..tissue(young_modulus) }
}

fn stepper(model: &Model, threads: usize) -> Stepper {
    Stepper::new(model, SolverSettings::FAST, FRAME, threads).unwrap()
}

/// Steps so many frames.
fn run(stepper: &mut Stepper, model: &Model, state: &mut State, tools: &[ToolMotion], frames: usize) {
    for _ in 0..frames {
        stepper.step(model, state, tools);
    }
}

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

fn still(pose: Pose) -> ToolMotion {
    ToolMotion { from: pose, to: pose }
}

fn mean(model: &Model, state: &State, body: usize) -> DVec3 {
    let x = state.positions(model, body);
    x.iter().sum::<DVec3>() / x.len() as f64
}

/// An isolated cube falls 4.9 m in a second.
#[test]
fn a_free_body_falls() {
    let mesh = block([4, 4, 4], 4e-3);
    for (name, case) in backends() {
        let model = Scene::new(case, &mesh).body(viscous(12e3), vec![], vec![]).build();
        let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
        let start = mean(&model, &state, 0);
        for _ in 0..60 {
            let report = stepper.step(&model, &mut state, &[]);
            assert!(report.divergence.is_none(), "{name}: {report:?}");
        }
        let fall = (mean(&model, &state, 0) - start).z;
        println!("{name}: falls {fall:.5} m");
        assert!((fall + 0.5 * 9.81).abs() < 1e-3, "{name}: {fall} m");
        // It keeps its shape.
        let size = state.position(&model, 0, 0).distance(state.position(&model, 0, mesh.vertices.len() - 1));
        assert!((size / (3f64.sqrt() * 16e-3) - 1.0).abs() < 1e-4, "{name}: {size} m");
    }
}

/// A spinning, stretched body without forces keeps its momentum.
#[test]
fn momentum_is_kept() {
    let mesh = block([4, 3, 3], 4e-3);
    for (name, case) in backends() {
        let mut builder = ModelBuilder::new().backend(case.backend);
        let material = viscous(12e3);
        let body = BodyDescription { name: "body".into(), mesh: &mesh, material, pinned: vec![], supports: vec![] };
        case.add(&mut builder, body).unwrap();
        let model = builder.build().unwrap();
        let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
        let centre = mean(&model, &state, 0);
        let drift = DVec3::new(0.05, -0.02, 0.03);
        for i in 0..mesh.vertices.len() {
            let arm = state.position(&model, 0, i) - centre;
            state.set_velocity(&model, 0, i, drift + DVec3::new(0.5, 0.3, 4.0).cross(arm) + 2.0 * arm.x * DVec3::X);
        }
        // After the first frame a lattice has its own best fit of the velocities.
        stepper.step(&model, &mut state, &[]);
        let start = mean(&model, &state, 0);
        for _ in 0..30 {
            assert!(stepper.step(&model, &mut state, &[]).divergence.is_none(), "{name}");
        }
        let speed = (mean(&model, &state, 0) - start) / (30.0 * FRAME);
        println!("{name}: drifts with {speed}");
        assert!((speed - drift).length() < 0.02 * drift.length(), "{name}: {speed} m/s");
    }
}

/// A column that hangs from its pinned top is stretched by rho g l^2 / (2 E).
#[test]
fn a_column_sags_under_its_weight() {
    let mesh = block([2, 2, 10], 4e-3);
    for (name, case) in backends() {
        let material = Material { poisson_ratio: 0.0, ..viscous(12e3) };
        let length = 40e-3;
        let top = nodes(&mesh, |p| p.z > length - 1e-6);
        let model = Scene::new(case, &mesh).body(material, top.clone(), vec![]).build();
        let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
        run(&mut stepper, &model, &mut state, &[], 90);
        let base = nodes(&mesh, |p| p.z < 1e-6);
        let sag = -state.centroid(&model, 0, &base).z;
        let expected = 1200.0 * 9.81 * length * length / (2.0 * 12e3);
        println!("{name}: sags {:.4} mm, expected {:.4} mm", 1e3 * sag, 1e3 * expected);
        assert!((sag / expected - 1.0).abs() < 0.05, "{name}: {sag} m, expected {expected} m");
        // Pins do not drift.
        let pins = |state: &State| top.iter().map(|i| state.position(&model, 0, *i as usize)).collect::<Vec<_>>();
        let before = pins(&state);
        let off = top.iter().zip(&before).map(|(i, p)| p.distance(mesh.vertices[*i as usize])).fold(0.0, f64::max);
        run(&mut stepper, &model, &mut state, &[], 60);
        let drift = pins(&state).iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        println!("{name}: pins are off by {off:.2e} m and drift by {drift:.2e} m");
        assert!(off < 2e-5, "{name}: a pin is off by {off} m");
        assert!(drift < 1e-7, "{name}: {drift} m");
    }
}

/// A strip whose end a tool holds.
fn strip() -> TetMesh {
    block([10, 2, 2], 3e-3)
}

fn jaws(jaw_force: f64) -> Compliance {
    Compliance { stiffness: 300.0, closing: DVec3::Y, jaw_force, friction: 0.6, tear_force: 1e3, blades: None }
}

/// A grasp begins without a snap, follows the tool, holds without drift, lets go, and grasps again.
#[test]
fn grasps_hold_without_snap_or_drift() {
    let mesh = strip();
    for (name, case) in backends() {
        for compliance in [None, Some(jaws(5.0))] {
            let base = nodes(&mesh, |p| p.x < 1e-6);
            let model = Scene::new(case, &mesh).body(viscous(12e3), base, vec![]).build();
            let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
            for _ in 0..60 {
                stepper.step(&model, &mut state, &[]);
            }
            let tip = nodes(&mesh, |p| p.x > 26e-3);
            for round in 0..2 {
                let home = at(state.centroid(&model, 0, &tip));
                let before = state.positions(&model, 0);
                let grasp = Grasp::capture(&model, &state, 0, &tip, 0, &home);
                state.grasps.push(match compliance {
                    Some(compliance) => grasp.compliant(compliance),
                    None => grasp,
                });
                stepper.step(&model, &mut state, &[still(home)]);
                let snap = |i: &u32| state.position(&model, 0, *i as usize).distance(before[*i as usize]);
                let snap = tip.iter().map(snap).fold(0.0, f64::max);
                println!("{name}, round {round}: snap {snap:.2e} m");
                assert!(snap < 2e-6, "{name}, {compliance:?}, round {round}: {snap} m");

                // It lifts and turns by 10 degrees in half a second, then holds for a second.
                let lifted =
                    Pose { translation: home.translation + 8e-3 * DVec3::Z, rotation: DQuat::from_rotation_y(-0.17) };
                let path = |share: f64| Pose {
                    translation: home.translation.lerp(lifted.translation, share),
                    rotation: home.rotation.slerp(lifted.rotation, share),
                };
                for k in 0..30 {
                    let motion = ToolMotion { from: path(k as f64 / 30.0), to: path((k + 1) as f64 / 30.0) };
                    let report = stepper.step(&model, &mut state, &[motion]);
                    assert!(report.divergence.is_none(), "{name}: {report:?}");
                }
                run(&mut stepper, &model, &mut state, &[still(lifted)], 30);
                let held: Vec<DVec3> = tip.iter().map(|i| state.position(&model, 0, *i as usize)).collect();
                run(&mut stepper, &model, &mut state, &[still(lifted)], 60);
                let moved = tip.iter().zip(&held).map(|(i, p)| state.position(&model, 0, *i as usize).distance(*p));
                let drift = moved.fold(0.0, f64::max);
                let force = stepper.forces()[0].constraint.force;
                println!("{name}, round {round}: drift {drift:.2e} m, pull {force}");
                assert!(drift < 1e-6, "{name}, {compliance:?}: {drift} m");
                // The strip hangs between its pinned end and the tool, which bears a part of it.
                assert!(force.z < -0.005 && force.z > -1.0, "{name}: {force} N");
                state.grasps.clear();
                run(&mut stepper, &model, &mut state, &[], 90);
            }
        }
    }
}

/// A pull below 2 mu N is held, one above is not.
#[test]
fn grasps_slip_at_coulombs_limit() {
    let mesh = strip();
    for (name, case) in backends() {
        for share in [0.9, 1.1] {
            let model = Scene::new(case, &mesh).body(viscous(12e3), vec![], vec![]).build();
            let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
            let weight = 1200.0 * 9.81 * mesh.volume();
            let tip = nodes(&mesh, |p| p.x < 9.1e-3);
            let grasp = Grasp::capture(&model, &state, 0, &tip, 0, &Pose::IDENTITY);
            state.grasps.push(grasp.compliant(jaws(share * weight / 1.2)));
            let mut walk = |frames: usize| {
                run(&mut stepper, &model, &mut state, &[still(Pose::IDENTITY)], frames);
                state.grasps[0].slip().z
            };
            let (first, last) = (walk(90), walk(60));
            println!("{name}: {share} of the weight slips {:.5} mm a second", 1e3 * (last - first));
            if share > 1.0 {
                assert!((last - first).abs() < 2e-5, "{name}: creeps from {first} to {last} m");
            } else {
                assert!(last - first < -5e-5, "{name}: holds from {first} to {last} m");
            }
        }
    }
}

/// On a slope below the angle of friction tissue lies still, on a steeper one it slides.
#[test]
fn friction_holds_up_to_its_angle() {
    let mesh = block([4, 4, 2], 4e-3);
    for (name, case) in backends() {
        for (slope, slides) in [(0.45, false), (0.75, true)] {
            let normal = DVec3::new(-f64::sin(f64::atan(slope)), 0.0, f64::cos(f64::atan(slope)));
            let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
            let turned = TetMesh { vertices: mesh.vertices.iter().map(|p| turn * *p).collect(), ..mesh.clone() };
            let plane = SupportPlane { point: DVec3::ZERO, normal, friction: 0.6 };
            let model = Scene::new(case, &turned).body(viscous(12e3), vec![], vec![plane]).build();
            let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
            run(&mut stepper, &model, &mut state, &[], 90);
            let before = mean(&model, &state, 0);
            run(&mut stepper, &model, &mut state, &[], 30);
            let way = mean(&model, &state, 0).distance(before);
            println!("{name}: on a slope of {slope} it goes {:.4} mm in half a second", 1e3 * way);
            assert_eq!(way > 1e-3, slides, "{name}: slope {slope}, {way} m");
            assert!(slides || way < 2e-5, "{name}: creeps by {way} m");
        }
    }
}

/// Two bodies, one on the other on a floor, a tool that presses the upper one, and a grasp.
fn busy(case: Case, mesh: &TetMesh) -> (Model, State) {
    let upper = TetMesh { vertices: mesh.vertices.iter().map(|p| *p + 14e-3 * DVec3::Z).collect(), ..mesh.clone() };
    let floor = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction: 0.6 };
    let mut builder = ModelBuilder::new().gravity(GRAVITY).backend(case.backend).body_contact(BodyContact::default());
    for (name, mesh) in [("lower", mesh), ("upper", &upper)] {
        let (name, material) = (name.to_owned(), viscous(12e3));
        let supports = vec![floor.into()];
        case.add(&mut builder, BodyDescription { name, mesh, material, pinned: vec![], supports }).unwrap();
    }
    let shape = Shape::Sphere { centre: DVec3::ZERO, radius: 4e-3 };
    builder.collider(Collider { name: "tip".into(), tool: 0, shape, rest_offset: 1.5e-3, friction: 0.4 }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let corner = nodes(&upper, |p| p.x < 1e-6 && p.z > 22e-3);
    let grasp = Grasp::capture(&model, &state, 1, &corner, 1, &Pose::IDENTITY);
    state.grasps.push(grasp);
    (model, state)
}

/// The motions of its tools in a frame.
fn tools(frame: usize) -> [ToolMotion; 2] {
    let tip = |k: usize| at(DVec3::new(9e-3, 9e-3, 36e-3 - 1e-4 * k.min(100) as f64));
    let jaw = |k: usize| at(DVec3::new(-5e-5, 0.0, 5e-5) * k.min(60) as f64);
    [ToolMotion { from: tip(frame), to: tip(frame + 1) }, ToolMotion { from: jaw(frame), to: jaw(frame + 1) }]
}

/// Tissue bears tissue and pushes a tool back; a saved state continues with the same bits, with any
/// number of threads.
#[test]
fn contact_bears_and_states_restore() {
    let mesh = block([4, 4, 3], 4e-3);
    for (name, case) in backends() {
        let (model, start) = busy(case, &mesh);
        let run = |threads: usize| {
            let (mut state, mut stepper) = (start.clone(), stepper(&model, threads));
            let mut saved = None;
            for frame in 0..120 {
                if frame == 90 {
                    saved = Some(state.clone());
                }
                let report = stepper.step(&model, &mut state, &tools(frame));
                assert!(report.divergence.is_none(), "{name}, frame {frame}: {report:?}");
            }
            let force = stepper.forces()[0];
            (state, saved.unwrap(), force)
        };
        let (state, saved, force) = run(1);
        println!("{name}: the tool is pressed by {:.4} N", force.contact.force.z);
        assert!(force.contact.force.z > 0.02, "{name}: {force:?}");
        // The upper body lies on the lower one and above the floor.
        let [lower, upper] = [0, 1].map(|body| mean(&model, &state, body).z);
        assert!(upper - lower > 8e-3, "{name}: {lower} {upper}");
        assert!(lower > 3e-3, "{name}: {lower}");

        assert_eq!(run(2).0.hash(), state.hash(), "{name}: threads change the bits");
        let (mut again, mut stepper) = (saved, stepper(&model, 1));
        for frame in 90..120 {
            stepper.step(&model, &mut again, &tools(frame));
        }
        assert_eq!(again.hash(), state.hash(), "{name}: a restored state continues otherwise");
        assert_eq!(again, state, "{name}");
    }
}

/// A cut leaves every node where it was; the piece that is cut off falls, the other stays.
#[test]
fn a_cut_parts_tissue_where_it_is() {
    let mesh = strip();
    for (name, case) in backends() {
        let base = nodes(&mesh, |p| p.x < 1e-6);
        let model = Scene::new(case, &mesh).body(viscous(12e3), base, vec![]).build();
        let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
        run(&mut stepper, &model, &mut state, &[], 60);
        let middle = state.centroid(&model, 0, &nodes(&mesh, |p| (p.x - 15e-3).abs() < 1e-6));
        let cut = sever(&model, &state, &Cut::through(0, middle, DVec3::X)).unwrap();
        assert_eq!(cut.pieces.len(), 2, "{name}");
        for piece in &cut.pieces {
            for (k, node) in piece.nodes.iter().enumerate() {
                let [now, before] =
                    [cut.state.position(&cut.model, piece.body, k), state.position(&model, 0, *node as usize)];
                assert_eq!(now, before, "{name}: node {node} moved");
            }
        }
        let (after, mut state) = (cut.model, cut.state);
        stepper.set_model(&after).unwrap();
        let before = [0, 1].map(|body| mean(&after, &state, body));
        stepper.step(&after, &mut state, &[]);
        let jump = mean(&after, &state, 1).distance(before[1]);
        assert!(jump < 3e-3, "{name}: the piece jumps by {jump} m");
        for frame in 0..30 {
            let report = stepper.step(&after, &mut state, &[]);
            assert!(report.divergence.is_none(), "{name}, frame {frame}: {report:?}");
        }
        let fell = [0, 1].map(|body| (before[body] - mean(&after, &state, body)).z);
        println!("{name}: the pieces fall by {fell:?} m");
        assert!(fell[1] > 1.2 && fell[1] < 1.4 && fell[0].abs() < 20e-3, "{name}: {fell:?}");
    }
}

/// What a backend cannot do is refused with one message.
#[test]
fn bad_input_is_refused() {
    let mesh = block([4, 4, 3], 4e-3);
    for (name, case) in backends() {
        let build = |backend: Backend, mesh: &TetMesh| {
            let mut builder = ModelBuilder::new().backend(backend);
            let material = tissue(12e3);
            let body = BodyDescription { name: "organ".into(), mesh, material, pinned: vec![], supports: vec![] };
            Case { backend, ..case }.add(&mut builder, body).map(|()| builder)
        };
        let mut flat = mesh.clone();
        flat.vertices.iter_mut().for_each(|p| p.z = 0.0);
        assert!(build(case.backend, &flat).unwrap_err().to_string().contains("organ"), "{name}");
        if let Backend::Lattice(settings) = case.backend {
            for cell in [0.0, f64::NAN, 1e-5, 0.5] {
                let error = build(Backend::Lattice(LatticeSettings { cell, ..settings }), &mesh).unwrap_err();
                assert!(error.to_string().contains("mm"), "{name}: {error}");
            }
        }
        let (model, state) = busy(case, &mesh);
        // A state of another model is not stepped.
        let other = State::new(&Scene::new(case, &mesh).body(tissue(12e3), vec![], vec![]).build());
        let mut stepper = stepper(&model, 1);
        let before = other.clone();
        let mut other = other;
        assert!(stepper.step(&model, &mut other, &[]).divergence.is_some(), "{name}");
        assert_eq!(other, before, "{name}");
        // A step of a broken state is undone and reported.
        let mut broken = state.clone();
        broken.set_position(&model, 0, 0, DVec3::NAN);
        assert!(stepper.step(&model, &mut broken, &tools(0)).divergence.is_some(), "{name}");
    }
}

/// Jaws that close on a block until they almost meet squeeze it flat between them. Nothing inverts,
/// and when they open it comes back.
#[test]
fn a_clamp_inverts_nothing() {
    let mesh = block([5, 4, 3], 4e-3);
    let pinned = nodes(&mesh, |p| p.x < 1e-9);
    for (name, case) in backends() {
        let mut builder = ModelBuilder::new().backend(case.backend).tool_contact(ToolContact::Surface);
        let (material, pinned, supports) = (viscous(6e3), pinned.clone(), vec![]);
        let body = BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports };
        case.add(&mut builder, body).unwrap();
        for tool in 0..2 {
            let shape = Shape::Capsule { ends: [-20e-3 * DVec3::Y, 20e-3 * DVec3::Y], radius: 1.5e-3 };
            let name = format!("jaw {tool}");
            builder.collider(Collider { name, tool, shape, rest_offset: 1.5e-3, friction: 0.6 }).unwrap();
        }
        let model = builder.build().unwrap();
        let (mut state, mut stepper) = (State::new(&model), stepper(&model, 1));
        let middle = DVec3::new(10e-3, 8e-3, 6e-3);
        let jaws = |gap: f64| [1.0, -1.0].map(|side| at(middle + (0.5 * gap + 3e-3) * side * DVec3::Z));
        // From 2 mm beside the block to a gap of 3 mm in a second, and back in half a second.
        let gap = |frame: i32| match frame {
            0..=60 => 16e-3 - 13e-3 * f64::from(frame) / 60.0,
            61..=90 => 3e-3,
            _ => 3e-3 + 13e-3 * (f64::from(frame - 90) / 30.0).min(1.0),
        };
        let mut smallest = f64::INFINITY;
        for frame in 0..180 {
            let motions = jaws(gap(frame)).into_iter().zip(jaws(gap(frame + 1)));
            let motions: Vec<ToolMotion> = motions.map(|(from, to)| ToolMotion { from, to }).collect();
            let report = stepper.step(&model, &mut state, &motions);
            assert_eq!((report.inverted, report.divergence), (0, None), "{name}, frame {frame}: {report:?}");
            smallest = smallest.min(report.min_volume_ratio);
        }
        let off = (0..mesh.vertices.len()).map(|i| state.position(&model, 0, i).distance(mesh.vertices[i]));
        let off = off.fold(0.0, f64::max);
        println!("{name}: smallest volume {smallest:.3} of that at rest; off by {:.4} mm at the end", 1e3 * off);
        assert!(smallest < 0.4, "{name} was hardly squeezed: {smallest}");
        assert!(off < 2e-4, "{name} does not come back: {off} m");
    }
}
