//! The stiffness of tissue against tools is the derivative of the force on them.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, block, nodes, refined, tissue};
use trocar_tissue::{
    BodyDescription, Collider, Compliance, Grasp, Material, Model, ModelBuilder, Shape, SolverSettings, State, Stepper,
    ToolMotion,
};

const EDGE: f64 = 2e-3;

/// A layer pinned at its bottom, with a ball as tool 1; with a finer collision surface if `fine`.
fn layer(young_modulus: f64, fine: bool) -> Model {
    let mesh = block([10, 10, 5], EDGE);
    let pinned = nodes(&mesh, |p| p.z < 1e-9);
    let material = Material { viscosity: 0.006 * young_modulus, ..tissue(young_modulus) };
    let mut builder = ModelBuilder::new().gravity(DVec3::ZERO);
    builder
        .body(BodyDescription { name: "layer".into(), mesh: &mesh, material, pinned, supports: Vec::new() })
        .unwrap();
    if fine {
        builder.collision_surface(0, &refined(&mesh.boundary().0)).unwrap();
    }
    let ball = Shape::Sphere { centre: DVec3::ZERO, radius: 4e-3 };
    builder.collider(Collider { name: "ball".into(), tool: 1, shape: ball, rest_offset: 0.0, friction: 0.5 }).unwrap();
    builder.build().unwrap()
}

/// The wrench of tissue on the tools 0 and 1 about `about`, in the order of the stiffness.
fn wrench(stepper: &Stepper, tools: &[Pose; 2], about: DVec3) -> [f64; 6] {
    let mut sum = [0.0; 6];
    for (force, tool) in stepper.forces().iter().zip(tools) {
        for part in [force.contact, force.constraint] {
            let torque = part.torque + (tool.translation - about).cross(part.force);
            (0..3).for_each(|c| (sum[c] += part.force[c], sum[3 + c] += torque[c]).0);
        }
    }
    sum
}

/// The tools moved together along one axis about `about`, by `step` (m or rad).
fn moved(tools: &[Pose; 2], about: DVec3, axis: usize, step: f64) -> [Pose; 2] {
    let unit = step * DVec3::AXES[axis % 3];
    tools.map(|tool| match axis < 3 {
        true => Pose { translation: tool.translation + unit, ..tool },
        false => {
            let turn = DQuat::from_scaled_axis(unit);
            Pose { rotation: turn * tool.rotation, translation: about + turn * (tool.translation - about) }
        }
    })
}

/// Settles the layer with tools at `tools`, and compares the stiffness along the first `axes` with
/// central differences over a frame. Returns the largest difference over the largest stiffness.
fn compare(name: &str, model: &Model, grasp: Option<Compliance>, tools: [Pose; 2], axes: usize) -> f64 {
    let (mut state, mut stepper) = (State::new(model), Stepper::new(model, SolverSettings::FAST, FRAME, 1).unwrap());
    let still = |tools: [Pose; 2]| tools.map(|tool| ToolMotion { from: tool, to: tool });
    if let Some(compliance) = grasp {
        let near = |i: &u32| {
            let p = state.position(model, 0, *i as usize);
            p.z > 7e-3 && p.distance(tools[0].translation) < 4e-3
        };
        let held: Vec<u32> = (0..model.bodies()[0].len() as u32).filter(near).collect();
        state.grasps.push(Grasp::capture(model, &state, 0, &held, 0, &tools[0]).compliant(compliance));
    }
    for _ in 0..90 {
        assert!(stepper.step(model, &mut state, &still(tools)).divergence.is_none());
    }
    let about = DVec3::new(11e-3, 9e-3, 12e-3);
    let stiffness = stepper.tool_stiffness(model, &state, &[0, 1], about);
    let mut worst: f64 = 0.0;
    // One radian at the lever of the tools is as large as a metre.
    let unit = |axis: usize| if axis < 3 { 1.0 } else { 4e-3 };
    let largest = (0..6).map(|i| stiffness[i][i] / (unit(i) * unit(i))).fold(0.0, f64::max);
    for column in 0..axes {
        let step = 2e-5 / unit(column);
        let sides = [1.0, -1.0].map(|sign| {
            let mut state = state.clone();
            let next = moved(&tools, about, column, sign * step);
            let motions = [0, 1].map(|k| ToolMotion { from: tools[k], to: next[k] });
            assert!(stepper.step(model, &mut state, &motions).divergence.is_none());
            wrench(&stepper, &next, about)
        });
        for row in 0..axes {
            let difference = (sides[1][row] - sides[0][row]) / (2.0 * step);
            let off = (difference - stiffness[row][column]).abs() / (unit(row) * unit(column));
            worst = worst.max(off / largest);
        }
    }
    println!(
        "{name}, {} Pa: {largest:.1} N/m, differences {:.1}%",
        model.bodies()[0].material().young_modulus,
        100.0 * worst
    );
    for i in 0..6 {
        assert!(stiffness[i][i] >= -1e-3 * largest, "{name}: diagonal {i} is {}", stiffness[i][i]);
        for j in 0..6 {
            assert_eq!(stiffness[i][j], stiffness[j][i]);
        }
    }
    worst
}

const AWAY: Pose = Pose { translation: DVec3::new(0.0, 0.0, 1.0), rotation: DQuat::IDENTITY };

#[test]
fn stiffness_of_a_grasp_is_the_derivative_of_its_force() {
    let compliance = Compliance {
        stiffness: 300.0,
        closing: DVec3::Y,
        jaw_force: 5.0,
        friction: 0.6,
        tear_force: 1e3,
        blades: None,
    };
    let tool = Pose { translation: DVec3::new(10e-3, 10e-3, 10e-3), ..Pose::IDENTITY };
    for young_modulus in [3e3, 48e3] {
        let compliant = compare("compliant grasp", &layer(young_modulus, false), Some(compliance), [tool, AWAY], 6);
        assert!(compliant < 0.02, "{compliant}");
    }
}

#[test]
fn stiffness_of_a_contact_is_the_derivative_of_its_force() {
    let ball = Pose { translation: DVec3::new(10e-3, 10e-3, 12.5e-3), ..Pose::IDENTITY };
    for young_modulus in [3e3, 48e3] {
        for (name, fine) in [("ball", false), ("ball on a fine surface", true)] {
            let pressed = compare(name, &layer(young_modulus, fine), None, [AWAY, ball], 3);
            // The ball is 1.5 mm deep in a layer of 10 mm; the stiffness is that of tissue at rest.
            assert!(pressed < 0.15, "{pressed}");
        }
    }
}

#[test]
fn nothing_touched_is_no_stiffness_and_steps_keep_their_bits() {
    let model = layer(12e3, false);
    let ball = Pose { translation: DVec3::new(10e-3, 10e-3, 12.5e-3), ..Pose::IDENTITY };
    let motions = |pose| [ToolMotion { from: AWAY, to: AWAY }, ToolMotion { from: pose, to: pose }];
    let walk = |asks: bool| {
        let (mut state, mut stepper) =
            (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
        for k in 0..20 {
            let pose = Pose { translation: ball.translation + DVec3::new(1e-4 * f64::from(k), 0.0, 0.0), ..ball };
            stepper.step(&model, &mut state, &motions(pose));
            if asks {
                assert_ne!(stepper.tool_stiffness(&model, &state, &[1], pose.translation), [[0.0; 6]; 6]);
            }
        }
        assert_eq!(stepper.tool_stiffness(&model, &state, &[0], AWAY.translation), [[0.0; 6]; 6]);
        state.hash()
    };
    assert_eq!(walk(true), walk(false));
}
