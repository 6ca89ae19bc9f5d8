//! Cut bodies: what falls off falls, held parts stay, and nothing else changes.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, appendix, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, Compliance, Cut, Grasp, MassFloor, Material, Model, ModelBuilder, Severed, SolverSettings, State,
    Stepper, sever, sever_part, sides,
};

fn material() -> Material {
    Material { viscosity: 20.0, ..tissue(12e3) }
}

fn one_body(mesh: &TetMesh, pinned: Vec<u32>) -> Model {
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let description = BodyDescription { name: "appendix".into(), mesh, material: material(), pinned, supports: vec![] };
    builder.body(description).unwrap();
    builder.build().unwrap()
}

fn run(stepper: &mut Stepper, model: &Model, state: &mut State, frames: usize) {
    for k in 0..frames {
        let report = stepper.step(model, state, &[]);
        assert_eq!((report.divergence, report.inverted), (None, 0), "frame {k}");
    }
}

/// Volume of a body as it lies (m3), its mass (kg).
fn volume_and_mass(model: &Model, state: &State, body: usize) -> (f64, f64) {
    let b = &model.bodies()[body];
    let mesh = TetMesh { vertices: state.positions(model, body), tets: b.tets().to_vec() };
    (mesh.volume(), (0..b.len()).map(|i| b.mass(i)).sum())
}

fn total(model: &Model, state: &State) -> (f64, f64) {
    let of = |body| volume_and_mass(model, state, body);
    (0..model.bodies().len()).map(of).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// Relative difference.
fn off(a: f64, b: f64) -> f64 {
    ((a - b) / b).abs()
}

/// A beam of 2 mm cubes that sticks out along x from a wall, and a tube held at its base.
fn organs() -> [(&'static str, TetMesh, f64); 2] {
    [("beam", block([24, 4, 4], 2e-3), 24e-3), ("tube", appendix(2.6e-3), 40e-3)]
}

/// Lets an organ hang for a while, cuts it through its middle, and steps the parts.
fn cut_through(mesh: &TetMesh, at: f64, schedule: SolverSettings, threads: usize) -> (Severed, State) {
    let model = one_body(mesh, nodes(mesh, |p| p.x < 6e-3));
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, schedule, FRAME, threads).unwrap();
    run(&mut stepper, &model, &mut state, 12);
    let middle = nodes(mesh, |p| (p.x - at).abs() < 2e-3);
    let point = state.centroid(&model, 0, &middle);
    let cut = sever(&model, &state, &Cut::through(0, point, DVec3::X)).unwrap();

    let (before, after) = (total(&model, &state), total(&cut.model, &cut.state));
    assert!(off(after.0, before.0) < 1e-12, "volume changed by {:e}", off(after.0, before.0));
    assert!(off(after.1, before.1) < 1e-6, "mass changed by {:e}", off(after.1, before.1));
    let energy = (state.kinetic_energy(&model), cut.state.kinetic_energy(&cut.model));
    assert!(off(energy.1, energy.0) < 1e-6, "{energy:?} J");
    assert_eq!(
        stepper.step(&cut.model, &mut cut.state.clone(), &[]).divergence.map(|d| d.to_string()).unwrap_or_default(),
        "the stepper or a grasp was made for another model"
    );

    let mut parted = cut.state.clone();
    stepper.set_model(&cut.model).unwrap();
    run(&mut stepper, &cut.model, &mut parted, 60);
    (cut, parted)
}

#[test]
fn an_organ_that_is_cut_through_is_two_bodies() {
    for (name, mesh, at) in organs() {
        for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
            let (cut, parted) = cut_through(&mesh, at, schedule, 1);
            assert!(mesh.tets.len() > 2000 && mesh.tets.len() < 5000, "{name}: {} elements", mesh.tets.len());
            let names: Vec<&str> = cut.model.bodies().iter().map(|b| b.name()).collect();
            assert_eq!(names, ["appendix", "appendix.1"], "{name}");
            assert!(cut.model.bodies().iter().all(|b| b.parts() == 1));
            assert_eq!(cut.pieces.iter().map(|p| p.body).collect::<Vec<_>>(), [0, 1]);
            // The base holds; the tip falls for a second, 4.9 m and how it moved before.
            let all = |body: usize| -> Vec<u32> { (0..cut.model.bodies()[body].len() as u32).collect() };
            let fell = |body: usize| {
                (parted.centroid(&cut.model, body, &all(body)) - cut.state.centroid(&cut.model, body, &all(body))).z
            };
            assert!(fell(0).abs() < 0.04, "{name}: the base fell by {} m", fell(0));
            assert!(fell(1) < -4.0 && fell(1) > -6.0, "{name}: the tip fell by {} m", fell(1));
            // The same bits again, and with two threads.
            for threads in [1, 2] {
                assert_eq!(
                    cut_through(&mesh, at, schedule, threads).1.hash(),
                    parted.hash(),
                    "{name}, {threads} threads"
                );
            }
        }
    }
}

/// Upper half of the beam's middle.
fn notch() -> Cut {
    let half_extents = [f64::INFINITY, 4.1e-3];
    Cut { body: 0, point: DVec3::new(12e-3, 4e-3, 8e-3), normal: DVec3::X, along: DVec3::Y, half_extents }
}

#[test]
fn a_partial_cut_leaves_one_piece_that_opens_under_load() {
    let mesh = block([12, 4, 4], 2e-3);
    let model = one_body(&mesh, nodes(&mesh, |p| p.x == 0.0));
    let cut = sever(&model, &State::new(&model), &notch()).unwrap();
    // Two rows of four squares; the crack's end, five nodes, stays joined.
    assert_eq!((cut.faces, cut.pieces.len()), (16, 1));
    let body = &cut.model.bodies()[0];
    assert_eq!((body.len(), body.parts(), body.name()), (mesh.vertices.len() + 10, 1, "appendix"));
    // Old nodes keep their numbers.
    assert_eq!(cut.pieces[0].nodes[..mesh.vertices.len()], (0..mesh.vertices.len() as u32).collect::<Vec<_>>());
    let copies = |k: usize| (cut.pieces[0].nodes[mesh.vertices.len() + k] as usize, mesh.vertices.len() + k);
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let mut state = cut.state.clone();
        let gap = |state: &State, k: usize| {
            let (one, other) = copies(k);
            state.position(&cut.model, 0, one).distance(state.position(&cut.model, 0, other))
        };
        assert!((0..10).all(|k| gap(&state, k) == 0.0));
        run(&mut Stepper::new(&cut.model, schedule, FRAME, 1).unwrap(), &cut.model, &mut state, 60);
        let widest = (0..10).map(|k| gap(&state, k)).fold(0.0, f64::max);
        assert!(widest > 2e-4, "the notch is {widest} m wide");
    }
}

#[test]
fn parts_of_a_cut_meet() {
    for (name, mesh, at) in organs() {
        let model = one_body(&mesh, vec![]);
        let cut = Cut { along: DVec3::Y, ..Cut::through(0, at * DVec3::X, DVec3::X) };
        let whole = sever(&model, &State::new(&model), &cut).unwrap();
        let above = sides(&model, &State::new(&model), &cut).unwrap();
        let (mut model, mut state) = (model.clone(), State::new(&model));
        // The last parts the body, so that its elements have their numbers until then.
        let ends = [f64::NEG_INFINITY, -1e-3, 0.0, 2e-3, f64::INFINITY];
        let mut faces = 0;
        for part in ends.windows(2) {
            assert_eq!(model.bodies().len(), 1, "{name}");
            let severed = sever_part(&model, &state, &cut, [part[0], part[1]], &above).unwrap();
            faces += severed.faces;
            (model, state) = (severed.model, severed.state);
        }
        assert_eq!((model.bodies().len(), faces), (whole.model.bodies().len(), whole.faces), "{name}");
        for (a, b) in model.bodies().iter().zip(whole.model.bodies()) {
            assert_eq!((a.len(), a.tets().len()), (b.len(), b.tets().len()), "{name}");
        }
        let refused = |part, sides: &[bool]| sever_part(&model, &state, &cut, part, sides).err().unwrap().to_string();
        assert!(
            refused([0.0, f64::NAN], &above).contains("no number") && refused([0.0; 2], &[]).contains("0 elements")
        );
    }
}

#[test]
fn a_body_may_be_cut_again_and_again() {
    let (_, mesh, _) = &organs()[1];
    let model = one_body(mesh, vec![]);
    let state = State::new(&model);
    let at = |x: f64, body: usize| Cut::through(body, DVec3::X * x, DVec3::X);
    let first = sever(&model, &state, &at(0.05, 0)).unwrap();
    // The larger part stays the body; the cut between did not touch the other.
    let second = sever(&first.model, &first.state, &at(0.02, 0)).unwrap();
    let third = sever(&second.model, &second.state, &at(0.07, 1)).unwrap();
    let fourth = sever(&third.model, &third.state, &at(0.01, 1)).unwrap();
    let names: Vec<&str> = third.model.bodies().iter().map(|b| b.name()).collect();
    assert_eq!(names, ["appendix", "appendix.1", "appendix.2", "appendix.1.1"]);
    assert_eq!((fourth.faces, fourth.state.hash()), (0, third.state.hash()));
    let (before, after) = (total(&model, &state), total(&third.model, &third.state));
    assert!(off(after.0, before.0) < 1e-12 && off(after.1, before.1) < 1e-6, "{before:?} {after:?}");
    let mut state = third.state;
    run(&mut Stepper::new(&third.model, SolverSettings::FAST, FRAME, 2).unwrap(), &third.model, &mut state, 30);
    // A notch, and then the rest of it.
    let beam = block([12, 4, 4], 2e-3);
    let model = one_body(&beam, vec![]);
    let notched = sever(&model, &State::new(&model), &notch()).unwrap();
    let through = sever(&notched.model, &notched.state, &Cut::through(0, DVec3::X * 12e-3, DVec3::X)).unwrap();
    assert_eq!((through.faces, through.pieces.len()), (16, 2));
    assert_eq!(through.model.bodies().iter().map(|b| b.len()).sum::<usize>(), beam.vertices.len() + 25);
}

#[test]
fn the_held_part_stays_and_the_other_falls() {
    let mesh = &organs()[1].1;
    let model = one_body(mesh, vec![]);
    let mut state = State::new(&model);
    let held = nodes(mesh, |p| p.x > 0.06 && p.x < 0.075);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY));
    let cut = sever(&model, &state, &Cut::through(0, DVec3::X * 0.05, DVec3::X)).unwrap();
    // The base is the larger part and keeps the name; the grasp goes with the tip.
    assert_eq!((cut.state.grasps.len(), cut.state.grasps[0].body), (1, 1));
    let was = |i: &u32| cut.pieces[1].nodes[*i as usize];
    assert_eq!(cut.state.grasps[0].nodes.iter().map(was).collect::<Vec<_>>(), held);
    let mut after = cut.state.clone();
    run(&mut Stepper::new(&cut.model, SolverSettings::FAST, FRAME, 1).unwrap(), &cut.model, &mut after, 60);
    for node in &cut.state.grasps[0].nodes {
        let move_of = after.position(&cut.model, 1, *node as usize) - cut.state.position(&cut.model, 1, *node as usize);
        assert_eq!(move_of, DVec3::ZERO);
    }
    assert!(after.position(&cut.model, 0, 0).z < -4.0);
}

#[test]
fn a_grasp_across_a_cut_holds_both_parts() {
    let mesh = block([24, 4, 4], 2e-3);
    let model = one_body(&mesh, vec![]);
    let mut state = State::new(&model);
    let compliance =
        Compliance { stiffness: 50.0, closing: DVec3::Z, jaw_force: 6.0, friction: 0.5, tear_force: 3.0, blades: None };
    let capture = |state: &State, held: &[u32]| Grasp::capture(&model, state, 0, held, 0, &Pose::IDENTITY);
    // Across the cut, more of it on the right; only on the cut; off it to the right, and one layer
    // on it.
    let across = nodes(&mesh, |p| p.x > 21e-3 && p.x < 29e-3);
    let on_it = nodes(&mesh, |p| p.x == 24e-3);
    let beside = nodes(&mesh, |p| p.x > 23e-3 && p.x < 29e-3);
    for held in [&across, &on_it, &beside] {
        let grasp = capture(&state, held).compliant(compliance);
        state.grasps.push(grasp);
    }
    let cut = sever(&model, &state, &Cut::through(0, DVec3::X * 24e-3, DVec3::X)).unwrap();
    let grasps: Vec<(usize, usize)> = cut.state.grasps.iter().map(|g| (g.body, g.nodes.len())).collect();
    let beside_is = cut.pieces.iter().position(|p| p.nodes.contains(&beside[2])).unwrap();
    // Layers of 25: one and the copies of the one on the cut to the left, three and the copies to
    // the right.
    let mut expected = vec![(0, 50), (1, 75), (0, 25), (1, 25), (beside_is, 75)];
    if grasps[0].1 == 75 {
        expected[..2].copy_from_slice(&[(0, 75), (1, 50)]);
    }
    assert_eq!(grasps, expected);
    let forces: Vec<f64> = cut.state.grasps.iter().map(|g| g.compliance.unwrap().jaw_force).collect();
    assert!((forces[0] + forces[1] - 6.0).abs() < 1e-12 && forces[4] == 6.0, "{forces:?}");
    assert!((forces[0] - 6.0 * grasps[0].1 as f64 / 125.0).abs() < 1e-12, "{forces:?}");
    // They do not pull: every node is at its target.
    for grasp in &cut.state.grasps {
        for (node, x) in grasp.prescribed(&Pose::IDENTITY) {
            assert!(cut.state.position(&cut.model, grasp.body, node as usize).distance(x) < 1e-12);
        }
    }
}

#[test]
fn what_was_before_a_cut_is_restored_to_the_bit() {
    let (mesh, other) = (block([12, 4, 4], 2e-3), block([3, 3, 3], 2e-3));
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    for (name, mesh) in [("cube", &other), ("appendix", &mesh)] {
        let pinned = nodes(mesh, |p| p.x == 0.0);
        let body = BodyDescription { name: name.into(), mesh, material: material(), pinned, supports: vec![] };
        builder.body(body).unwrap();
    }
    let model = builder.build().unwrap();
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let mut stepper = Stepper::new(&model, schedule, FRAME, 2).unwrap();
        let mut state = State::new(&model);
        run(&mut stepper, &model, &mut state, 10);
        let saved = state.clone();
        run(&mut stepper, &model, &mut state, 30);
        let never_cut = state.hash();

        // Where the beam hangs now.
        let top = nodes(&mesh, |p| p.x == 12e-3 && p.z == 8e-3);
        let cut = Cut { body: 1, point: saved.centroid(&model, 1, &top), ..notch() };
        let cut = sever(&model, &saved, &cut).unwrap();
        assert!(cut.faces > 4 && cut.pieces.len() == 1);
        let mut after = cut.state.clone();
        stepper.set_model(&cut.model).unwrap();
        run(&mut stepper, &cut.model, &mut after, 30);
        let mut fresh = cut.state.clone();
        run(&mut Stepper::new(&cut.model, schedule, FRAME, 1).unwrap(), &cut.model, &mut fresh, 30);
        assert_eq!(after.hash(), fresh.hash(), "a stepper that followed the cut does as a new one");
        assert_ne!(after.hash(), never_cut);

        let mut restored = saved.clone();
        stepper.set_model(&model).unwrap();
        run(&mut stepper, &model, &mut restored, 30);
        assert_eq!(restored.hash(), never_cut);
        // The cube knows nothing of the cut.
        for i in 0..other.vertices.len() {
            assert_eq!(after.position(&cut.model, 0, i), restored.position(&model, 0, i));
        }
    }
}

#[test]
fn masses_pins_and_filters_are_handed_down() {
    let (mesh, other) = (block([12, 4, 4], 2e-3), block([3, 3, 3], 2e-3));
    for floor in [MassFloor::None, MassFloor::MedianShare(0.9)] {
        let mut builder = ModelBuilder::new().gravity(GRAVITY).mass_floor(floor);
        for (name, mesh) in [("appendix", &mesh), ("cube", &other)] {
            let pinned = nodes(mesh, |p| p.z == 0.0);
            let body = BodyDescription { name: name.into(), mesh, material: material(), pinned, supports: vec![] };
            builder.body(body).unwrap();
        }
        builder.filter_pair(0, 1).unwrap();
        builder.filter_pair(1, 1).unwrap();
        let model = builder.build().unwrap();
        let state = State::new(&model);
        let cut = sever(&model, &state, &Cut::through(0, DVec3::X * 12e-3, DVec3::X)).unwrap();
        let (before, after) = (total(&model, &state).1, total(&cut.model, &cut.state).1);
        assert!(off(after, before) < 1e-6, "{floor:?}: {before} kg, {after} kg");
        let raised = |model: &Model, body: usize| model.bodies()[body].raised_masses();
        assert_eq!(raised(&cut.model, 0) > 0, floor != MassFloor::None);
        assert!(raised(&cut.model, 0) + raised(&cut.model, 2) >= raised(&model, 0));
        for piece in &cut.pieces {
            let pinned = cut.model.bodies()[piece.body].pinned();
            assert!(piece.nodes.iter().zip(pinned).all(|(was, now)| model.bodies()[0].pinned()[*was as usize] == *now));
            assert!(pinned.contains(&true));
        }
        // Bodies: appendix, cube, appendix.1.
        assert!(!cut.model.collides(1, 2) && !cut.model.collides(0, 1) && !cut.model.collides(1, 1));
        assert!(cut.model.collides(0, 2) && cut.model.collides(2, 2));
        let again = sever(&cut.model, &cut.state, &Cut::through(1, DVec3::X * 2e-3, DVec3::X)).unwrap();
        assert!(!again.model.collides(3, 3) && !again.model.collides(1, 3) && !again.model.collides(0, 3));
        assert!(!again.model.collides(2, 3) && again.model.collides(0, 2));
    }
}

#[test]
fn loose_parts_that_are_not_cut_stay_with_the_body() {
    let mut mesh = block([12, 2, 2], 2e-3);
    let island = block([2, 2, 2], 2e-3);
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(island.vertices.iter().map(|p| p + DVec3::Y * 0.05));
    mesh.tets.extend(island.tets.iter().map(|t| t.map(|i| i + first)));
    let model = one_body(&mesh, vec![]);
    assert_eq!(model.bodies()[0].parts(), 2);
    let cut = sever(&model, &State::new(&model), &Cut::through(0, DVec3::X * 16e-3, DVec3::X)).unwrap();
    let parts: Vec<usize> = cut.model.bodies().iter().map(|b| b.parts()).collect();
    assert_eq!(parts, [2, 1]);
    assert!(cut.pieces[0].nodes.contains(&first) && !cut.pieces[1].nodes.contains(&first));
}

#[test]
fn a_cut_that_meets_nothing_changes_nothing_and_a_wrong_one_is_refused() {
    let mesh = block([4, 4, 4], 2e-3);
    let model = one_body(&mesh, vec![]);
    let state = State::new(&model);
    let good = Cut::through(0, DVec3::splat(4e-3), DVec3::X);
    let beside = Cut { point: DVec3::new(4e-3, 0.5, 0.0), half_extents: [0.01; 2], ..good };
    for cut in [Cut::through(0, DVec3::X, DVec3::X), beside] {
        let cut = sever(&model, &state, &cut).unwrap();
        assert_eq!((cut.faces, cut.pieces.len(), cut.state.hash()), (0, 1, state.hash()));
        assert_eq!(cut.pieces[0].nodes.len(), mesh.vertices.len());
    }
    let other = one_body(&block([4, 4, 5], 2e-3), vec![]);
    let refused = |model: &Model, cut: Cut| sever(model, &state, &cut).unwrap_err().to_string();
    for (message, expected) in [
        (refused(&model, Cut { body: 1, ..good }), "body 1 is to be cut; there are 1"),
        (refused(&model, Cut { point: DVec3::NAN, ..good }), "finite"),
        (
            refused(&model, Cut { normal: 2.0 * DVec3::X, ..good }),
            "body 'appendix': a cut's normal is 2 long; it must be a unit vector",
        ),
        (refused(&model, Cut { normal: DVec3::ZERO, ..good }), "unit vector"),
        (refused(&model, Cut { along: DVec3::X, ..good }), "not in its plane"),
        (refused(&model, Cut { half_extents: [0.0, 1.0], ..good }), "above 0"),
        (refused(&model, Cut { half_extents: [1.0, f64::NAN], ..good }), "above 0"),
        (refused(&other, good), "another model"),
    ] {
        assert!(message.contains(expected) && !message.contains('\n'), "{message}");
    }
}
