//! Copy, restore and hash carry every number of a state.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use super::State;
use super::body_state::{BodyState, WarmStart};
use super::{Anchor, FeatureAnchor, Source, Stretch};
use crate::{
    Backend, BodyDescription, Compliance, ConstitutiveModel, Grasp, Hole, LatticeSettings, Material, Model,
    ModelBuilder,
};
use glam::{DVec3, Vec3A};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_lattice::BodyState as LatticeState;

/// Two elements.
fn model() -> Model {
    let p = |x: f64, y: f64, z: f64| 1e-2 * DVec3::new(x, y, z);
    let vertices = vec![p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0), p(0.0, 0.0, 1.0), p(1.0, 1.0, 1.0)];
    let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [1, 2, 3, 4]] };
    let material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity: 0.0,
    };
    let body = BodyDescription { name: "body".into(), mesh: &mesh, material, pinned: vec![], supports: vec![] };
    let backend = Backend::Lattice(LatticeSettings { cell: 0.02, ..LatticeSettings::default() });
    let mut builder = ModelBuilder::new().backend(backend);
    builder.body(body).unwrap();
    builder.build().unwrap()
}

/// A state in which nothing is empty.
fn full(model: &Model) -> State {
    let mut state = State::new(model);
    let body = &mut state.bodies[0];
    body.anchors.push(Anchor { vertex: 1, source: Source::Collider(2), place: Vec3A::new(1.0, 2.0, 3.0) });
    let stretch = Vec3A::new(7.0, 8.0, 9.0);
    body.feature_anchors.push(FeatureAnchor {
        collider: 1,
        feature: ([0, 1, 0], 1),
        stretch,
        weights: [0.5, 0.5, 0.0],
    });
    body.stretches.push(Stretch { vertex: 2, other: 3, by: Vec3A::new(4.0, 5.0, 6.0) });
    let compliance = Compliance {
        stiffness: 1.0,
        closing: DVec3::Y,
        jaw_force: 2.0,
        friction: 3.0,
        tear_force: 4.0,
        blades: Some([5, 6]),
    };
    let grasp = Grasp::capture(model, &state, 0, &[0, 3], 1, &Pose::IDENTITY).compliant(compliance);
    state.grasps.push(grasp);
    state.holes.push(Hole { body: 1, tools: vec![2], nodes: vec![3, 5] });
    state
}

/// A change of one number of a state.
type Change = Box<dyn Fn(&mut State)>;

fn change(of: impl Fn(&mut State) + 'static) -> Change {
    Box::new(of)
}

/// A change of each coordinate of each vector of a list.
fn vectors(list: fn(&mut BodyState) -> &mut Vec<Vec3A>, vertices: usize) -> Vec<Change> {
    let all = (0..vertices).flat_map(|i| (0..3).map(move |c| (i, c)));
    all.map(|(i, c)| change(move |s| list(&mut s.bodies[0])[i][c] += 1.0)).collect()
}

/// A change of each number of the body's state. Destructuring names every field: a new one that has
/// no change here does not compile.
fn body_changes(body: &BodyState) -> Vec<Change> {
    let BodyState { x, v, anchors, feature_anchors, stretches, disturbed, warm, lattice, follows: _ } = body;
    let WarmStart { falling, supported } = warm;
    let mut all = vectors(|body| &mut body.x, x.len());
    assert!(!*disturbed && anchors.len() == 1 && stretches.len() == 1);
    let [FeatureAnchor { collider: _, feature: _, stretch: _, weights: _ }] = feature_anchors[..] else {
        panic!("one is there")
    };
    all.push(change(|s| s.bodies[0].feature_anchors[0].collider += 1));
    all.extend((0..3).map(|k| change(move |s| s.bodies[0].feature_anchors[0].feature.0[k] += 1)));
    all.push(change(|s| s.bodies[0].feature_anchors[0].feature.1 += 1));
    all.extend((0..3).map(|c| change(move |s| s.bodies[0].feature_anchors[0].stretch[c] += 1.0)));
    all.extend((0..3).map(|k| change(move |s| s.bodies[0].feature_anchors[0].weights[k] += 1.0)));
    all.extend(vectors(|body| &mut body.v, v.len()));
    all.extend((0..falling.len()).map(|i| change(move |s| s.bodies[0].warm.falling[i] += 0.5)));
    all.extend((0..supported.len()).map(|i| change(move |s| s.bodies[0].warm.supported[i] ^= true)));
    let Anchor { vertex: _, source: _, place: _ } = anchors[0];
    all.push(change(|s| s.bodies[0].anchors[0].vertex += 1));
    for source in [Source::Collider(3), Source::Support(2), Source::Body(2)] {
        all.push(change(move |s| s.bodies[0].anchors[0].source = source));
    }
    all.extend((0..3).map(|c| change(move |s| s.bodies[0].anchors[0].place[c] += 1.0)));
    let Stretch { vertex: _, other: _, by: _ } = stretches[0];
    all.push(change(|s| s.bodies[0].stretches[0].vertex += 1));
    all.push(change(|s| s.bodies[0].stretches[0].other += 1));
    all.extend((0..3).map(|c| change(move |s| s.bodies[0].stretches[0].by[c] += 1.0)));
    let LatticeState { positions, velocities } = lattice.as_ref().unwrap();
    assert_eq!(positions.len(), velocities.len());
    for (i, c) in (0..positions.len()).flat_map(|i| (0..3).map(move |c| (i, c))) {
        all.push(change(move |s| s.bodies[0].lattice.as_mut().unwrap().positions[i][c] += 1.0));
        all.push(change(move |s| s.bodies[0].lattice.as_mut().unwrap().velocities[i][c] += 1.0));
    }
    all.push(change(|s| s.bodies[0].disturbed ^= true));
    all
}

/// A change of each number of the grasp.
fn grasp_changes(grasp: &Grasp) -> Vec<Change> {
    let Grasp { tool: _, body: _, nodes, captured, captured_at: _, compliance, slid, slips: _, torn: _ } = grasp;
    // `blades` is not part of the hash.
    let Compliance { stiffness: _, closing: _, jaw_force: _, friction: _, tear_force: _, blades: _ } =
        compliance.unwrap();
    let mut all = vec![
        change(|s| s.grasps[0].tool += 1),
        change(|s| s.grasps[0].body += 1),
        change(|s| s.grasps[0].slips ^= true),
        change(|s| s.grasps[0].torn ^= true),
        change(|s| s.grasps[0].compliance = None),
        change(|s| s.grasps[0].compliance.as_mut().unwrap().stiffness += 1.0),
        change(|s| s.grasps[0].compliance.as_mut().unwrap().jaw_force += 1.0),
        change(|s| s.grasps[0].compliance.as_mut().unwrap().friction += 1.0),
        change(|s| s.grasps[0].compliance.as_mut().unwrap().tear_force += 1.0),
        change(|s| s.grasps[0].captured_at.rotation.x += 1.0),
        change(|s| s.grasps[0].captured_at.rotation.y += 1.0),
        change(|s| s.grasps[0].captured_at.rotation.z += 1.0),
        change(|s| s.grasps[0].captured_at.rotation.w += 1.0),
    ];
    all.extend((0..nodes.len()).map(|k| change(move |s| s.grasps[0].nodes[k] += 1)));
    for c in 0..3 {
        all.extend((0..captured.len()).map(|k| change(move |s| s.grasps[0].captured[k][c] += 1.0)));
        all.extend((0..slid.len()).map(|k| change(move |s| s.grasps[0].slid[k][c] += 1.0)));
        all.push(change(move |s| s.grasps[0].captured_at.translation[c] += 1.0));
        all.push(change(move |s| s.grasps[0].compliance.as_mut().unwrap().closing[c] += 1.0));
    }
    all
}

#[test]
fn hash_and_copies_carry_every_number() {
    let model = model();
    let state = full(&model);
    let State { time: _, grasps, holes, bodies } = &state;
    let Hole { body: _, tools: _, nodes: _ } = &holes[0];
    let mut changes = body_changes(&bodies[0]);
    let of_body = changes.len();
    changes.extend(grasp_changes(&grasps[0]));
    changes.push(change(|s| s.time += 1.0));
    changes.push(change(|s| s.holes[0].body += 1));
    changes.push(change(|s| s.holes[0].tools[0] += 1));
    changes.push(change(|s| s.holes[0].nodes[1] += 1));
    changes.push(change(|s| s.holes.clear()));
    let mut hashes = vec![state.hash()];
    for (k, change) in changes.iter().enumerate() {
        let mut changed = state.clone();
        change(&mut changed);
        assert!(changed != state, "change {k} changes nothing");
        assert!(!hashes.contains(&changed.hash()), "the hash misses change {k}");
        hashes.push(changed.hash());
        if k < of_body {
            let mut copy = State::new(&model).bodies.remove(0);
            copy.copy_from(&changed.bodies[0]);
            assert_eq!(copy, changed.bodies[0], "the copy misses change {k}");
        }
    }
}
