//! The step: friction holds, limits are kept, stiff couplings are stable, and the bits are
//! reproducible.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

mod common;

use common::{Random, between, noise, posture, rod, skewed};
use glam::DVec3;
use std::time::Instant;
use trocar_robot::chain::{ArmState, Coupling, CouplingLaw, Drive, JointLimits, Joints, SerialArm};

const DT: f64 = 1.0 / 480.0;

fn loaded() -> SerialArm {
    SerialArm::franka_fr3().unwrap().with_payload(rod(0.5, 0.2)).unwrap()
}

/// Friction of 0.2 N m a joint, without damping and limits.
fn rough() -> SerialArm {
    loaded().with_friction(&[0.2; 7], &[0.0; 7]).unwrap()
}

#[test]
fn friction_holds_without_creep() {
    let arm = rough();
    // A controller with masses 2% too low commands too little torque. If the difference is below
    // friction, nothing moves at all.
    let believed = arm.clone().with_mass_scaled(0.98, 0.95).unwrap();
    let q = arm.posture(&[0.3, -0.1, 0.2, -1.0, 0.1, 1.0, 0.4]).unwrap();
    let torque = believed.gravity_torque(&q);
    let missing =
        arm.gravity_torque(&q).iter().zip(torque.iter()).map(|(a, b)| a - b).fold(0.0, |m: f64, x| m.max(x.abs()));
    let rough = arm.clone().with_friction(&[1.0; 7], &[0.0; 7]).unwrap();
    let mut state = ArmState::at_rest(q);
    for _ in 0..4800 {
        let report = rough.step(&mut state, &Drive { torque, external: arm.zeros() }, &mut [], DT, 1).unwrap();
        assert_eq!(report.stuck.iter().count(), 7);
    }
    assert_eq!(state, ArmState::at_rest(q));
    // With less friction than the missing torque the joint slides.
    let slippery = arm.with_friction(&[0.5 * missing; 7], &[0.0; 7]).unwrap();
    for _ in 0..480 {
        slippery.step(&mut state, &Drive { torque, external: slippery.zeros() }, &mut [], DT, 1).unwrap();
    }
    assert!(state.q != q, "the load is above friction");
}

#[test]
fn a_moving_arm_comes_to_rest_and_stays() {
    let arm = rough();
    let mut state = ArmState { q: arm.home(), qd: Joints::from_fn(7, |i| [0.3, -0.2, 0.4, 0.1, -0.5, 0.3, 0.6][i]) };
    let mut at_rest = None;
    for _ in 0..4800 {
        let drive = Drive { torque: arm.gravity_torque(&state.q), external: arm.zeros() };
        let report = arm.step(&mut state, &drive, &mut [], DT, 1).unwrap();
        assert!(report.converged);
        if let Some(q) = at_rest {
            assert_eq!(state, ArmState::at_rest(q), "at rest once, at rest for ever: no chatter");
        } else if state.qd.max_abs() == 0.0 {
            at_rest = Some(state.q);
        }
    }
    assert!(at_rest.is_some());
}

/// One joint: a spinning wheel slows down at friction / inertia; a block on a slope has v(t) = v0 -
/// a t up to the step.
#[test]
fn friction_slows_a_joint_by_coulombs_law() {
    let arm = skewed(1).with_gravity(DVec3::ZERO).unwrap().with_friction(&[0.3], &[0.0]).unwrap();
    let inertia = arm.mass_matrix(&arm.zeros()).row(0)[0];
    let mut state = ArmState { q: arm.zeros(), qd: Joints::new(&[2.0]).unwrap() };
    let drive = Drive { torque: arm.zeros(), external: arm.zeros() };
    for k in 1..=40 {
        let report = arm.step(&mut state, &drive, &mut [], DT, 1).unwrap();
        let expected = (2.0 - 0.3 / inertia * k as f64 * DT).max(0.0);
        assert!((state.qd[0] - expected).abs() < 1e-12, "{} {expected}", state.qd[0]);
        assert!(state.qd[0] == 0.0 || (report.resisting[0] + 0.3).abs() < 1e-9);
    }
}

#[test]
fn limits_hold_under_any_torque() {
    let arm = loaded();
    let mut rng = Random(11);
    let mut seen = [0; 3];
    for _ in 0..40 {
        let mut state = ArmState::at_rest(posture(&arm, &mut rng));
        for k in 0..240 {
            let size = 10f64.powf(between(&mut rng, 0.0, 6.0));
            let external = if k % 3 == 0 { noise(7, size, &mut rng) } else { arm.zeros() };
            let drive = Drive { torque: noise(7, size, &mut rng), external };
            let report = arm.step(&mut state, &drive, &mut [], DT, 2).unwrap();
            for (i, s) in arm.segments().iter().enumerate() {
                let l = &s.joint.limits;
                assert!((l.position[0]..=l.position[1]).contains(&state.q[i]));
                assert!(state.qd[i].abs() <= l.velocity && report.torque[i].abs() <= l.effort);
                assert_eq!(report.torque_limited.contains(i), drive.torque[i].abs() > l.effort);
            }
            let sets = [report.torque_limited, report.at_position_limit, report.at_velocity_limit];
            for (seen, set) in seen.iter_mut().zip(sets) {
                *seen += usize::from(!set.is_empty());
            }
            assert!(report.converged);
        }
    }
    assert!(seen.iter().all(|s| *s > 100), "{seen:?}");
}

#[test]
fn a_stop_takes_the_speed_and_holds() {
    let arm = loaded().with_friction(&[0.0; 7], &[0.0; 7]).unwrap();
    let mut state = ArmState { q: arm.home(), qd: arm.zeros() };
    state.qd[0] = 2.0;
    let drive = |s: &ArmState| {
        let mut torque = arm.gravity_torque(&s.q);
        torque[0] += 20.0;
        Drive { torque, external: arm.zeros() }
    };
    for _ in 0..960 {
        let pushed = drive(&state);
        arm.step(&mut state, &pushed, &mut [], DT, 1).unwrap();
    }
    let pushed = drive(&state);
    let report = arm.step(&mut state, &pushed, &mut [], DT, 1).unwrap();
    assert_eq!((state.q[0], state.qd[0]), (2.7437, 0.0));
    assert!(report.at_position_limit.contains(0));
    // The other joints are undamped, still swing a little and press through the base.
    assert!((report.resisting[0] + 20.0).abs() < 10.0, "{}", report.resisting[0]);
}

/// A light arm at a stiff rim: a sliding shaft of 0.5 kg, held by a spring far too stiff for an
/// explicit step.
#[test]
fn a_stiff_coupling_is_stable_and_correct() {
    // The last joint of the arm is prismatic, with a link of 0.5 kg.
    let mut segments = skewed(3).segments().to_vec();
    segments[2].mass = rod(0.5, 0.1);
    let arm = SerialArm::new("light", segments, trocar_core::Pose::IDENTITY).unwrap();
    for stiffness in [1e3, 5e4, 1e6, 1e9] {
        let mut state = ArmState::at_rest(arm.zeros());
        let mut place = None;
        let mut held = 0.0;
        let mut worst: f64 = 0.0;
        for k in 0..1920 {
            let frames = arm.frames(&state.q);
            let at = frames.flange().translation;
            let anchor = *place.get_or_insert(at);
            let jacobian = frames.flange_jacobian();
            let mut couplings = [DVec3::X, DVec3::Y, DVec3::Z].map(|d| {
                let c = Coupling::new(jacobian.row(d), (at - anchor).dot(d), stiffness, CouplingLaw::Bilateral);
                Coupling { damping: 2.0, ..c }
            });
            arm.step(&mut state, &Drive { torque: arm.zeros(), external: arm.zeros() }, &mut couplings, DT, 1).unwrap();
            worst = worst.max((at - anchor).length());
            held = DVec3::new(couplings[0].force, couplings[1].force, couplings[2].force).length();
            assert!(state.qd.max_abs() < 20.0, "{stiffness} N/m at step {k}: {:?}", state.qd);
        }
        assert!(worst < 4.0 * 30.0 / stiffness + 1e-4 && held > 1.0 && held < 60.0, "{worst} {held}");
    }
}

/// Pressed onto a plane with 10 N and pulled along it below and above the friction limit.
#[test]
fn a_contact_only_pushes_and_its_friction_holds_below_the_limit() {
    let arm = loaded().with_friction(&[0.0; 7], &[1.0; 7]).unwrap();
    const FRICTION: f64 = 0.4;
    for (pull, holds) in [(3.0, true), (5.0, false)] {
        let mut state = ArmState::at_rest(arm.home());
        let ground = arm.frames(&state.q).flange().translation;
        // The anchor of friction's spring; it slides at the limit.
        let mut anchor = ground;
        let mut last = [0.0; 2];
        let mut start = ground;
        for k in 0..1440 {
            if k == 960 {
                start = arm.frames(&state.q).flange().translation;
            }
            let frames = arm.frames(&state.q);
            let at = frames.flange().translation;
            let jacobian = frames.flange_jacobian();
            let mut torque = arm.gravity_torque(&state.q);
            let pressed = jacobian.torque(DVec3::new(pull, 0.0, -10.0), DVec3::ZERO);
            torque.iter_mut().zip(pressed.iter()).for_each(|(t, p)| *t += p);
            let friction = CouplingLaw::Friction { of: 0, coefficient: FRICTION };
            let mut couplings = [
                Coupling::new(jacobian.row(DVec3::Z), (at - ground).z, 3e4, CouplingLaw::Push),
                Coupling::new(jacobian.row(DVec3::X), (at - anchor).x, 3e4, friction),
                Coupling::new(jacobian.row(DVec3::Y), (at - anchor).y, 3e4, friction),
            ];
            let report = arm.step(&mut state, &Drive { torque, external: arm.zeros() }, &mut couplings, DT, 1).unwrap();
            assert!(report.converged);
            assert!(
                couplings[0].force >= 0.0
                    && couplings[1].force.abs() <= FRICTION * couplings[0].force * (1.0 + 1e-6) + 1e-9
            );
            last = [couplings[0].force, couplings[1].force];
            // Sliding: the anchor follows at the limit's extension.
            let now = arm.frames(&state.q).flange().translation;
            let reach = FRICTION * couplings[0].force / 3e4;
            anchor.x = now.x - (now.x - anchor.x).clamp(-reach, reach);
            anchor.y = now.y - (now.y - anchor.y).clamp(-reach, reach);
        }
        let slid = (arm.frames(&state.q).flange().translation - start).x;
        if holds {
            assert!(slid.abs() < 2e-5 && (last[1] + pull).abs() < 0.2 && (last[0] - 10.0).abs() < 0.2);
        } else {
            assert!(slid > 1e-3);
        }
    }
    // Above the plane there is no force.
    let mut state = ArmState::at_rest(arm.home());
    let row = arm.frames(&state.q).flange_jacobian().row(DVec3::Z);
    let mut touch = [Coupling::new(row, 1e-3, 1e5, CouplingLaw::Push)];
    let drive = Drive { torque: arm.gravity_torque(&state.q), external: arm.zeros() };
    arm.step(&mut state, &drive, &mut touch, DT, 1).unwrap();
    assert_eq!(touch[0].force, 0.0);
}

fn hash(state: &ArmState) -> u64 {
    let bits = state.q.iter().chain(state.qd.iter()).map(|x| x.to_bits());
    bits.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ b).wrapping_mul(0x0100_0000_01b3).rotate_left(7))
}

#[test]
fn a_repeated_run_has_the_same_bits_also_from_a_snapshot() {
    let arm = loaded();
    let run = |from: ArmState, steps: std::ops::Range<usize>| {
        let mut state = from;
        for k in steps {
            let torque =
                Joints::from_fn(7, |i| arm.gravity_torque(&state.q)[i] + 6.0 * (0.02 * k as f64 + i as f64).sin());
            let frames = arm.frames(&state.q);
            let at = frames.flange().translation;
            let row = frames.flange_jacobian().row(DVec3::Z);
            let mut touch = [Coupling::new(row, at.z - 0.45, 3e4, CouplingLaw::Push)];
            arm.step(&mut state, &Drive { torque, external: arm.zeros() }, &mut touch, DT, 2).unwrap();
        }
        state
    };
    let start = ArmState::at_rest(arm.home());
    let whole = run(start, 0..960);
    assert_eq!(hash(&whole), hash(&run(start, 0..960)));
    let snapshot = run(start, 0..400);
    assert_eq!(hash(&whole), hash(&run(snapshot, 400..960)));
}

#[test]
fn invalid_steps_are_refused_and_leave_the_state() {
    let arm = loaded();
    let start = ArmState::at_rest(arm.home());
    let still = Drive { torque: arm.zeros(), external: arm.zeros() };
    let mut bad = still;
    bad.external[2] = f64::NAN;
    let mut huge = still;
    huge.external[2] = f64::MAX;
    let mut short = still;
    short.torque = Joints::zeros(3);
    let free = arm.clone().with_limits(&[JointLimits::NONE; 7]).unwrap();
    for (drive, dt, substeps) in
        [(bad, DT, 1), (short, DT, 1), (still, 0.0, 1), (still, DT, 0), (still, f64::NAN, 1), (huge, 1e300, 1)]
    {
        let mut state = start;
        assert!(free.step(&mut state, &drive, &mut [], dt, substeps).is_err());
        assert_eq!(state, start);
    }
    let alone = CouplingLaw::Friction { of: 0, coefficient: 0.3 };
    let row = arm.frames(&start.q).flange_jacobian().row(DVec3::Z);
    for coupling in [
        Coupling::new(row, 0.0, 1e4, alone),
        Coupling::new(row, f64::NAN, 1e4, CouplingLaw::Push),
        Coupling::new(row, 0.0, -1.0, CouplingLaw::Push),
    ] {
        let mut state = start;
        assert!(arm.step(&mut state, &still, &mut [coupling], DT, 1).is_err());
    }
}

/// Prints the cost of a step. The bound is 3% of a core for two arms at 480 Hz, with a margin for a
/// busy machine.
#[test]
fn a_step_is_cheap() {
    let arm = loaded();
    let mut state = ArmState::at_rest(arm.home());
    const STEPS: usize = 4800;
    let mut cost = [f64::INFINITY; 2];
    for (kind, cost) in cost.iter_mut().enumerate() {
        for _ in 0..5 {
            let start = Instant::now();
            for k in 0..STEPS {
                let t = 0.01 * k as f64;
                let mut torque = arm.gravity_torque(&state.q);
                torque.iter_mut().enumerate().for_each(|(i, x)| *x += 3.0 * (t + i as f64).sin());
                let frames = arm.frames(&state.q);
                let jacobian = frames.flange_jacobian();
                let at = frames.flange().translation;
                let friction = CouplingLaw::Friction { of: 0, coefficient: 0.3 };
                let mut touch = [
                    Coupling::new(jacobian.row(DVec3::Z), at.z - 0.48, 3e4, CouplingLaw::Push),
                    Coupling::new(jacobian.row(DVec3::X), 0.0, 3e4, friction),
                    Coupling::new(jacobian.row(DVec3::Y), 0.0, 3e4, friction),
                ];
                let drive = Drive { torque, external: arm.zeros() };
                arm.step(&mut state, &drive, &mut touch[..3 * kind], DT, 1).unwrap();
            }
            *cost = cost.min(start.elapsed().as_secs_f64() / STEPS as f64);
        }
    }
    let share = 2.0 * 480.0 * cost[1];
    println!(
        "a step {:.2} us, at a rim with friction {:.2} us; two arms at 480 Hz {:.2}% of a core",
        cost[0] * 1e6,
        cost[1] * 1e6,
        100.0 * share
    );
    assert!(share < 0.03, "{share}");
}

/// Random couplings of any stiffness and number are solved, obey their laws, and never add energy
/// (no drive, no gravity).
#[test]
fn random_couplings_are_solved_and_add_no_energy() {
    let arm = loaded().with_gravity(DVec3::ZERO).unwrap();
    let mut rng = Random(31);
    let mut unsolved = 0;
    const STEPS: usize = 3000;
    for _ in 0..STEPS {
        let qd = noise(7, 1.0, &mut rng);
        let mut state = ArmState { q: posture(&arm, &mut rng), qd };
        let frames = arm.frames(&state.q);
        let jacobian = frames.flange_jacobian();
        let count = 1 + (between(&mut rng, 0.0, 6.0) as usize);
        let mut couplings: Vec<Coupling> = (0..count)
            .map(|k| {
                let way = DVec3::from_array(std::array::from_fn(|_| between(&mut rng, -1.0, 1.0))).normalize();
                let law = match (k, between(&mut rng, 0.0, 3.0) as usize) {
                    (1.., 0) => CouplingLaw::Friction { of: 0, coefficient: 0.5 },
                    (_, 1) => CouplingLaw::Bilateral,
                    _ => CouplingLaw::Push,
                };
                let stiffness = 10f64.powf(between(&mut rng, 1.0, 9.0));
                Coupling {
                    damping: between(&mut rng, 0.0, 50.0),
                    ..Coupling::new(jacobian.row(way), 0.0, stiffness, law)
                }
            })
            .collect();
        let law = couplings[0].law;
        if matches!(law, CouplingLaw::Friction { .. }) {
            continue;
        }
        let before = arm.energy(&state.q, &state.qd).0;
        let still = Drive { torque: arm.zeros(), external: arm.zeros() };
        // The mass matrix of the step is that of its start.
        let matrix = arm.mass_matrix(&state.q);
        let bias = arm.bias(&state.q, &state.qd);
        let report = arm.step(&mut state, &Drive { external: bias, ..still }, &mut couplings, DT, 1).unwrap();
        unsolved += usize::from(!report.converged);
        let after = 0.5 * state.qd.dot(&matrix.times(&state.qd));
        assert!(after <= before * (1.0 + 1e-9), "{after} {before}");
        for c in &couplings {
            match c.law {
                CouplingLaw::Push => assert!(c.force >= 0.0),
                CouplingLaw::Friction { .. } => {
                    assert!(c.force.abs() <= 0.5 * couplings[0].force.abs() * (1.0 + 1e-3) + 1e-6 * before);
                }
                CouplingLaw::Bilateral => {
                    let expected = -(c.stiffness * c.displacement + c.damping * c.row.dot(&state.qd));
                    assert!((c.force - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{} {expected}", c.force);
                }
            }
        }
    }
    assert!(unsolved < STEPS / 50, "{unsolved}");
}
