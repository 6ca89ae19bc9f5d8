//! Golden hashes of the comparators and the oracle: refactoring keeps every bit of their results.
//!
//! They hold on x86-64 and on 64-bit ARM (`cargo xtask aarch64`).

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Grasp, Load, Material, Model, ModelBuilder, State, SupportPlane, ToolMotion,
};
use trocar_tissue_reference::{
    Held, Newton, Oracle, OracleState, Scheme, SemiImplicit, Xpbd, XpbdConstraints, stable_explicit_step,
};

/// A held body and one that slides down a plane.
fn scene(constitutive: ConstitutiveModel) -> (Model, State) {
    let mesh = block([2, 2, 3], 3e-3);
    let material = Material { model: constitutive, viscosity: 4.0, ..tissue(8e3) };
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "held".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::new(0.6, 0.0, 0.8), friction: 0.3 };
    let supports = vec![plane.into()];
    builder.body(BodyDescription { name: "slides".into(), mesh: &mesh, material, pinned: vec![], supports }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let held = nodes(&mesh, |p| p.z > 8e-3 && p.x < 1e-3);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY));
    (model, state)
}

fn at(frame: usize) -> Pose {
    Pose { translation: DVec3::new(0.0, 1e-3, 2e-3) * (frame as f64 / 8.0), ..Pose::IDENTITY }
}

/// FNV-1a over the bits of some numbers.
fn fold(hash: u64, numbers: impl Iterator<Item = f64>) -> u64 {
    numbers
        .flat_map(|x| x.to_bits().to_le_bytes())
        .fold(hash, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

fn stepped(constitutive: ConstitutiveModel, scheme: Scheme) -> u64 {
    let (model, mut state) = scene(constitutive);
    let mut stepper = scheme.stepper(&model, FRAME, 1).unwrap();
    let loads = [Load { body: 0, node: 20, force: DVec3::new(1e-3, 0.0, 2e-3) }];
    for k in 0..8 {
        stepper.step_with_loads(&model, &mut state, &[ToolMotion { from: at(k), to: at(k + 1) }], &loads);
    }
    let force = stepper.forces().first().map_or(DVec3::ZERO, |force| force.constraint.force);
    fold(state.hash(), force.to_array().into_iter())
}

#[test]
fn comparators() {
    let stable = |c| SemiImplicit::stable(&scene(c).0, FRAME);
    let mut found = Vec::new();
    for constitutive in ConstitutiveModel::ALL {
        for scheme in [
            Scheme::SemiImplicit(stable(constitutive)),
            Scheme::Xpbd(Xpbd::default()),
            Scheme::Xpbd(Xpbd { constraints: XpbdConstraints::Strains, ..Xpbd::default() }),
            Scheme::Newton(Newton { substeps: 2 }),
        ] {
            found.push(stepped(constitutive, scheme));
        }
        found.push(stable_explicit_step(&scene(constitutive).0).to_bits());
    }
    found.push(stepped(ConstitutiveModel::StableNeoHookean, Scheme::Xpbd(Xpbd::NEWTON)));
    let golden: [u64; 16] = [
        0xceadb13cb553e165,
        0xf4b408da34eab4f1,
        0xb6b28ddc773a2ac3,
        0x5478cb45ee6c0930,
        0x3f38e3f581a58e3e,
        0x58d21ee61f381b43,
        0xc37ccffec33b7086,
        0xc37ccffec33b7086,
        0x9d1cf724028330f6,
        0x3f38e3f581a58e3d,
        0xecd2abb94d3035be,
        0x5828fa0ecef9e698,
        0x5828fa0ecef9e698,
        0xce14ccdf9e741fa0,
        0x3f38e3f581a58e3e,
        0xe1d6d26cf7352dd1,
    ];
    assert_eq!(found, golden, "{found:#018x?}");
}

#[test]
fn oracle() {
    let mut found = Vec::new();
    for constitutive in ConstitutiveModel::ALL {
        let (model, state) = scene(constitutive);
        let mut oracle = Oracle::new(&model);
        let mut exact = OracleState::from_state(&model, &state);
        let mut hash = 0xcbf2_9ce4_8422_2325;
        for k in 0..4 {
            let held = Held::by(&state.grasps[0], &at(k + 1));
            oracle.step(&model, &mut exact, FRAME / 2.0, &held).unwrap();
        }
        for body in 0..2 {
            let numbers = exact.positions(body).iter().chain(exact.velocities(body));
            hash = fold(hash, numbers.flat_map(|x| x.to_array()));
        }
        found.push(hash);
        found.push(exact.to_state(&model, &OracleState::new(&model), FRAME).unwrap().hash());
    }
    let golden: [u64; 6] = [
        0xe5b872853fd4d9ac,
        0x819e22ce47621d99,
        0x9be0772143b69494,
        0xf7c5f2956f6ca124,
        0x8f603df208c41907,
        0x98a52faf3435e199,
    ];
    assert_eq!(found, golden, "{found:#018x?}");
}
