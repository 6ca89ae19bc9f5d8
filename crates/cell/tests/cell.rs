//! The two-arm cell around a small analytic tube.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{go, over};
use glam::{DQuat, DVec3};
use trocar_cell::{Action, ActionSpace, Cell, CellEvent, CellReport, ContactParts, Setpoint};
use trocar_core::Pose;
use trocar_robot::wrench::ForceKind;
use trocar_scene::{Arm, Drive, GraspDesignName, Scene, Side};
use trocar_specimen::{Pins, Specimen};
use trocar_testing::tube::{ONE_END, meshed, scene, two_tubes};

const ARMS: [&str; 2] = ["left", "right"];

fn cell(specimen: &Specimen) -> Cell {
    Cell::new(&scene(), specimen, 1).unwrap()
}

#[test]
fn illegal_actions_are_refused_by_name_and_change_nothing() {
    let mut cell = cell(&meshed(ONE_END, 4e-3));
    cell.step(None).unwrap();
    let before = cell.hash();
    let good = Action::targets(&ARMS.map(|arm| cell.setpoint(arm).unwrap()));
    let mut said = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut action = good.clone();
        change(&mut action.numbers);
        let text = cell.step(&action).unwrap_err().to_string();
        assert_eq!(cell.hash(), before, "{text}");
        text
    };
    assert!(said(&|a| a[5] = f64::NAN).contains("action[5], right first pivot"));
    assert!(said(&|a| a[1] = 0.9).contains("left second pivot"));
    assert!(said(&|a| a[2] = 0.5).contains("left insertion"));
    assert!(said(&|a| a[8] = f64::NEG_INFINITY).contains("right roll"));
    assert!(said(&|a| a[9] = -0.1).contains("right jaw"));
    assert!(said(&|a| a.truncate(9)).contains("10 numbers"));
    assert!(said(&|a| a.push(0.0)).contains("10 numbers"));
    assert!(said(&Vec::clear).contains("10 numbers"));
    let tip = Action { space: ActionSpace::Tip, numbers: vec![0.0; 10] };
    let mut far = tip.clone();
    far.numbers[7] = 0.05;
    assert!(cell.step(&far).unwrap_err().to_string().contains("right tip z"));
    assert!(cell.measured_cp("middle").unwrap_err().to_string().contains("left, right"));
    assert!(cell.servo_jaw("left", 2.0).is_err() && cell.servo_jp("left", &[0.0; 3]).is_err());
    assert!(cell.servo_jp("left", &[f64::NAN; 7]).is_err());
    assert_eq!(cell.hash(), before);
    cell.step(&tip).unwrap();
}

/// Moves `arm` to a pose of its tip with the jaw at `jaw`, in `periods`, by actions; the actions
/// that it took.
fn send(cell: &mut Cell, arm: &str, pose: &Pose, jaw: f64, periods: usize) -> (Vec<Action>, Vec<CellReport>) {
    let k = cell.arm_index(arm).unwrap();
    let from: Vec<Setpoint> = cell.observe().iter().map(|a| a.commanded).collect();
    let to = cell.solve(arm, pose, &from[k]).unwrap().setpoint.with_jaw(jaw);
    let mut made = (Vec::new(), Vec::new());
    for n in 1..=periods {
        let mut all = from.clone();
        all[k] = from[k].towards(&to, n as f64 / periods as f64);
        let action = Action::targets(&all);
        made.1.push(cell.step(&action).unwrap());
        made.0.push(action);
    }
    made
}

/// Grasps the tube at `at` with `arm` and lifts it by `rise` (m).
fn grasp_and_lift(cell: &mut Cell, arm: &str, at: DVec3, rise: f64) -> (Vec<Action>, Vec<CellReport>) {
    let pose = over(cell, arm, at, 0.0);
    let back = Pose { translation: pose.translation + 0.025 * DVec3::Z, ..pose };
    let up = Pose { translation: pose.translation + rise * DVec3::Z, ..pose };
    let mut all = (Vec::new(), Vec::new());
    for (to, jaw, periods) in [(back, 1.0, 60), (pose, 1.0, 30), (pose, 0.0, 45), (up, 0.0, 45), (up, 0.0, 30)] {
        let (actions, reports) = send(cell, arm, &to, jaw, periods);
        all.0.extend(actions);
        all.1.extend(reports);
    }
    all
}

/// The middle of the tube's free half in the cell (m).
const HELD: DVec3 = DVec3::new(0.006, 0.46, 0.045);

#[test]
fn a_restored_state_goes_on_to_the_bit_and_threads_do_not_matter() {
    let specimen = two_tubes(ONE_END, 3e-3);
    let mut one = cell(&specimen);
    let (actions, _) = grasp_and_lift(&mut one, "left", HELD, 0.005);
    assert!(one.held("left").unwrap().is_some(), "something is held when the state is saved");
    // The same actions on two threads.
    let mut two = Cell::new(&scene(), &specimen, 2).unwrap();
    actions.iter().for_each(|a| drop(two.step(a).unwrap()));
    assert_eq!(one.hash(), two.hash());
    let later = actions[100..112].to_vec();
    let go = |cell: &mut Cell| -> (Vec<CellReport>, u64) {
        let reports = later.iter().map(|a| cell.step(a).unwrap()).collect();
        (reports, cell.hash())
    };
    let saved = one.save();
    assert_eq!(saved.hash(), one.hash());
    let first = go(&mut one);
    assert_ne!(first.1, saved.hash());
    one.restore(&saved).unwrap();
    assert_eq!(one.hash(), saved.hash());
    assert_eq!(go(&mut one), first);
    // In another cell, too.
    two.restore(&saved).unwrap();
    assert_eq!(go(&mut two), first);
    let mut new = cell(&specimen);
    new.restore(&saved).unwrap();
    assert_eq!(go(&mut new), first);
}

/// The cell with one arm that is ideal, in its port or without one.
fn ideal(port: bool) -> Scene {
    let mut scene = scene();
    scene.arms.truncate(1);
    match port {
        true => (scene.arms[0].drive, scene.arms[0].base) = (Drive::Ideal, None),
        false => scene.arms[0] = Arm::free(Side::Left, "grasper", [0.0, 0.46, 0.12]),
    }
    scene.instruments.truncate(1);
    scene.task.name = trocar_scene::TaskName::GraspLift;
    scene.task.organ = "tube".to_owned();
    scene
}

#[test]
fn every_kind_of_arm_lifts_the_tube_by_actions() {
    let specimen = two_tubes(ONE_END, 2.2e-3);
    for (name, mut scene) in [("dynamic", scene()), ("ideal in a port", ideal(true)), ("free", ideal(false))] {
        for design in [GraspDesignName::LivePose, GraspDesignName::Compliant] {
            scene.task.grasp = design;
            let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
            let (_, reports) = grasp_and_lift(&mut cell, "left", HELD, 0.015);
            let carried = cell.carried(0).unwrap();
            let worst = |of: fn(&CellReport) -> f64| reports.iter().map(of).fold(0.0, f64::max);
            assert!((carried.tissue_lift - 0.015).abs() < 0.002 && carried.slip < 0.003, "{name}: {carried:?}");
            assert!(reports.iter().all(|r| r.tissue.inverted == 0 && r.tissue.divergence.is_none()), "{name}");
            assert!(worst(|r| r.arms[0].rcm_peak) < if name == "dynamic" { 3e-3 } else { 1e-12 });
            let step = worst(|r| r.activation_step);
            assert!(step > 0.0 && step < 1e-3, "{name}: the first frame of the grasp moves {step} m");
            let snap = reports.iter().flat_map(|r| &r.events).find_map(|e| match e {
                CellEvent::Attached { snap_mm, .. } => Some(*snap_mm),
                _ => None,
            });
            assert_eq!(snap, Some(0.0), "live-pose capture prescribes nodes where they are");
            let arm = &cell.observe()[0];
            assert!(arm.attached && arm.force.kind == ForceKind::Constraint && arm.constraint.length() > 0.02);
            assert_eq!(cell.measured_cf("left").unwrap().kind, ForceKind::Constraint);
            assert_eq!(cell.link_poses("left").unwrap().is_empty(), name != "dynamic");
            // Jaws that open let go.
            cell.servo_jaw("left", 1.0).unwrap();
            let events: Vec<CellEvent> = (0..6).flat_map(|_| cell.step(None).unwrap().events).collect();
            assert!(events.iter().any(|e| matches!(e, CellEvent::Released { .. })), "{events:?}");
            assert!(!cell.observe()[0].attached && cell.world().state.grasps.is_empty());
        }
    }
}

/// What the benchmark of grasps compares with: a lift of the same tissue without contact.
#[test]
fn a_cell_without_contact_lifts_what_another_has_grasped() {
    let specimen = two_tubes(ONE_END, 2.2e-3);
    let mut scene = ideal(false);
    scene.task.grasp = GraspDesignName::LivePose;
    let mut with = Cell::new(&scene, &specimen, 1).unwrap();
    let none = ContactParts { organs: false, instruments: false };
    let mut without = Cell::with_contact(&scene, &specimen, 1, none).unwrap();
    let (actions, _) = grasp_and_lift(&mut Cell::new(&scene, &specimen, 1).unwrap(), "left", HELD, 0.015);
    let held = |cell: &Cell| cell.world().state.grasps.first().map(|grasp| grasp.nodes.clone());
    let height = |cell: &Cell, nodes: &[u32]| cell.world().state.centroid(&cell.world().model, 0, nodes).z;
    let mut grasped_at = None;
    for action in &actions {
        with.step(action).unwrap();
        without.step(action).unwrap();
        without.hold_as(&with);
        assert_eq!(held(&without), held(&with));
        if let (None, Some(nodes)) = (grasped_at, held(&with)) {
            grasped_at = Some([&with, &without].map(|cell| height(cell, &nodes)));
        }
    }
    let nodes = held(&with).unwrap();
    for (cell, from) in [&with, &without].into_iter().zip(grasped_at.unwrap()) {
        let lift = height(cell, &nodes) - from;
        assert!((lift - 0.015).abs() < 0.001, "{lift}");
    }
    with.servo_jaw("left", 1.0).unwrap();
    without.servo_jaw("left", 1.0).unwrap();
    for _ in 0..6 {
        with.step(None).unwrap();
        without.step(None).unwrap();
        without.hold_as(&with);
    }
    assert_eq!([held(&with), held(&without)], [None, None], "both have released");
}

/// The local model of the tissue predicts the force after a small motion of the tip.
#[test]
fn a_haptic_model_predicts_the_force_of_the_next_motion() {
    let mut cell = Cell::new(&ideal(false), &two_tubes(ONE_END, 2.2e-3), 1).unwrap();
    grasp_and_lift(&mut cell, "left", HELD, 0.01);
    let before = cell.haptic_model("left").unwrap();
    assert!(before.wrench.force.length() > 0.02, "{before:?}");
    let saved = cell.save();
    for axis in DVec3::AXES {
        cell.restore(&saved).unwrap();
        cell.step(None).unwrap();
        let before = cell.haptic_model("left").unwrap();
        let pose = cell.measured_cp("left").unwrap();
        send(&mut cell, "left", &Pose { translation: pose.translation + 2e-4 * axis, ..pose }, 0.0, 1);
        let after = cell.haptic_model("left").unwrap();
        let moved = after.tip.translation - before.tip.translation;
        assert!(moved.length() > 1e-4, "{moved}");
        let row = |c: usize| (0..3).map(|k| before.stiffness[c][k] * moved[k]).sum::<f64>();
        let expected = -DVec3::new(row(0), row(1), row(2));
        let change = after.wrench.force - before.wrench.force;
        println!("moved {:.3} mm: {:.4} N, expected {:.4} N", 1e3 * moved, change, expected);
        // The tube is bent by 20 degrees, and relaxes within the period's second frame.
        let share = expected.length() / change.length();
        assert!((0.5..2.0).contains(&share), "{change} N, {expected} N expected");
        assert!(change.dot(expected) > 0.85 * change.length() * expected.length(), "{change} N, {expected} N expected");
    }
    cell.servo_jaw("left", 1.0).unwrap();
    let back = Pose { translation: before.tip.translation + 0.03 * DVec3::Z, ..before.tip };
    send(&mut cell, "left", &back, 1.0, 30);
    assert_eq!(cell.haptic_model("left").unwrap().stiffness, [[0.0; 6]; 6], "away from tissue");
}

/// Places of the tip of an ideal arm (m) at its start and after each of `count` tip actions of 1 mm
/// along x, with a delay of `ms`; and the state's hash in the end.
fn moved_late(ms: f64, count: usize) -> (Vec<DVec3>, u64) {
    let mut scene = ideal(false);
    scene.rates.control_delay_ms = ms;
    let mut cell = Cell::new(&scene, &meshed(ONE_END, 4e-3), 1).unwrap();
    let action = Action { space: ActionSpace::Tip, numbers: vec![1e-3, 0.0, 0.0, 0.0, 1.0] };
    let mut places = vec![cell.measured_cp("left").unwrap().translation];
    for _ in 0..count {
        cell.step(&action).unwrap();
        places.push(cell.measured_cp("left").unwrap().translation);
    }
    (places, cell.hash())
}

#[test]
fn late_actions_move_the_arm_as_much_and_later() {
    let (at_once, _) = moved_late(0.0, 8);
    // One and two periods, and a period and a half: halfway between two places of a period's end.
    for (periods, half, ms) in [(1, false, 1000.0 / 30.0), (2, false, 2000.0 / 30.0), (1, true, 50.0)] {
        let (late, _) = moved_late(ms, 8);
        assert!(late[..=periods].iter().all(|p| *p == at_once[0]), "{ms} ms: {late:?}");
        for k in periods + 1..=8 {
            let whole = at_once[k - periods];
            let expected = if half { 0.5 * (whole + at_once[k - periods - 1]) } else { whole };
            assert!(late[k].distance(expected) < 1e-9, "{ms} ms, period {k}: {} is not {expected}", late[k]);
        }
    }
}

#[test]
fn waiting_actions_are_part_of_the_state_and_bad_ones_never_wait() {
    let mut scene = scene();
    scene.rates.control_delay_ms = 110.0;
    let specimen = meshed(ONE_END, 4e-3);
    let action = |x: f64| Action { space: ActionSpace::Tip, numbers: [x, 0.0, 0.0, 0.0, 0.5].repeat(2) };
    let mut one = Cell::new(&scene, &specimen, 1).unwrap();
    (0..3).for_each(|k| drop(one.step(&action(1e-3 * f64::from(k))).unwrap()));
    let saved = one.save();
    let before = one.hash();
    assert!(one.step(&action(1.0)).unwrap_err().to_string().contains("left tip x"), "refused when it is given");
    assert_eq!(one.hash(), before);
    let go = |cell: &mut Cell| -> Vec<u64> {
        let one = |_| {
            cell.step(None).unwrap();
            cell.hash()
        };
        (0..6).map(one).collect()
    };
    let first = go(&mut one);
    let mut other = Cell::new(&scene, &specimen, 2).unwrap();
    other.restore(&saved).unwrap();
    assert_eq!((other.hash(), go(&mut other)), (before, first));
    // A restart forgets them.
    let starts: Vec<Setpoint> = ARMS.map(|arm| other.setpoint(arm).unwrap()).to_vec();
    let tip = |cell: &mut Cell| {
        cell.restart(&saved, &starts).unwrap();
        (0..6).for_each(|_| drop(cell.step(None).unwrap()));
        cell.setpoint("left").unwrap()
    };
    assert_eq!(tip(&mut other), starts[0]);
}

/// Brings open jaws to the tube and closes them by `jaws`, an opening a period: the force of the
/// hold and that of the event (N), if anything is held.
fn close_by(jaws: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    close_on(&two_tubes(ONE_END, 2.2e-3), HELD, jaws)
}

/// The same at a place of a specimen.
fn close_on(specimen: &Specimen, at: DVec3, jaws: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut cell = Cell::new(&ideal(false), specimen, 1).unwrap();
    let pose = over(&cell, "left", at, 0.0);
    let back = Pose { translation: pose.translation + 0.025 * DVec3::Z, ..pose };
    send(&mut cell, "left", &back, 1.0, 60);
    send(&mut cell, "left", &pose, 1.0, 30);
    let mut said = None;
    for jaw in jaws {
        for event in send(&mut cell, "left", &pose, jaw, 1).1.into_iter().flat_map(|report| report.events) {
            if let CellEvent::Attached { closing_force_n, .. } = event {
                said = Some(closing_force_n);
            }
        }
    }
    let hold = cell.world().state.grasps.first().and_then(|g| g.compliance).map(|c| c.jaw_force);
    assert_eq!(hold.is_some(), said.is_some());
    Some((hold?, said?))
}

#[test]
fn jaws_that_a_command_stops_hold_with_what_they_press() {
    let whole = close_by(std::iter::repeat_n(0.0, 30)).unwrap();
    assert!(whole.0 == 0.5 && whole.1 >= 0.475, "all the force: {whole:?}");
    let stopped = close_by(std::iter::repeat_n(0.45, 30)).unwrap();
    assert!(stopped.0 == stopped.1 && (0.05..0.45).contains(&stopped.0), "a part of it: {stopped:?}");
    // On their way they pass that opening, and hold where they end.
    let ramp = (1..=30).map(|k| (1.0 - 0.05 * f64::from(k)).max(0.0));
    assert_eq!(close_by(ramp).unwrap().0, 0.5);
    // Wide jaws that tissue hardly presses hold nothing.
    assert_eq!(close_by(std::iter::repeat_n(0.9, 30)), None);
}

#[test]
fn jaws_hold_nothing_that_only_one_blade_presses() {
    // Stiff tissue that stays where it is: beside its middle, one blade meets it and stops the
    // jaws, while a part of it is loose between them.
    let mut specimen = two_tubes(Pins::Band { share: 0.42 }, 2.2e-3);
    specimen.organs[0].material.young_modulus_pa = 2e5;
    let close = |aside: f64| close_on(&specimen, HELD + aside * DVec3::Y, std::iter::repeat_n(0.0, 30));
    assert!(close(0.0).is_some_and(|(force, _)| force == 0.5));
    assert_eq!(close(0.0035), None);
    assert_eq!(close(-0.0035), None);
}

#[test]
fn a_free_arm_refuses_what_it_cannot_do_and_keeps_the_speed_limits() {
    let specimen = meshed(ONE_END, 4e-3);
    let mut cell = Cell::new(&ideal(false), &specimen, 1).unwrap();
    let hash = cell.hash();
    let said = |cell: &mut Cell, numbers: [f64; 5]| {
        let action = Action { space: ActionSpace::Pivots, numbers: numbers.to_vec() };
        cell.step(&action).unwrap_err().to_string()
    };
    assert!(said(&mut cell, [0.0, 0.46, 0.5, 0.0, 1.0]).contains("action[2], left z"));
    assert!(said(&mut cell, [0.0, 0.46, 0.1, 4.0, 1.0]).contains("left roll"));
    assert!(cell.measured_js("left").unwrap_err().to_string().contains("ideal"));
    assert!(cell.servo_jp("left", &[0.0; 7]).unwrap_err().to_string().contains("no joints"));
    assert_eq!(cell.hash(), hash);
    // Far targets are approached at the greatest speed, and reached.
    let to = Setpoint([0.05, 0.46, 0.12, 0.4, 0.0]);
    let mut places = vec![cell.measured_cp("left").unwrap().translation];
    for _ in 0..30 {
        cell.step(&Action::targets(&[to])).unwrap();
        places.push(cell.measured_cp("left").unwrap().translation);
    }
    let most = places.windows(2).map(|p| p[0].distance(p[1])).fold(0.0, f64::max);
    assert!(most <= trocar_cell::TIP_SPEED * cell.period() + 1e-12, "{most} m a period");
    assert!(places[30].distance(DVec3::new(0.05, 0.46, 0.12)) < 1e-12, "{}", places[30]);
    // Steps of the tip work for it, too.
    let by = Action { space: ActionSpace::Tip, numbers: vec![0.0, 0.002, 0.0, 0.0, 1.0] };
    cell.step(&by).unwrap();
    assert!((cell.measured_cp("left").unwrap().translation.y - 0.462).abs() < 1e-12);
}

#[test]
fn pressing_on_stiff_tissue_neither_swings_nor_drifts_and_the_shaft_comes_back() {
    let mut specimen = two_tubes(Pins::Band { share: 0.42 }, 3e-3);
    for young_modulus_pa in [12e3, 100e3, 1e6] {
        specimen.organs[0].material.young_modulus_pa = young_modulus_pa;
        let mut cell = cell(&specimen);
        cell.servo_jaw("left", 0.0).unwrap();
        let top = DVec3::new(0.0, 0.46, 0.045 + 0.0045);
        // Closed blades, their tips 10 mm above the tube; then 4 mm into it, and back.
        let above = over(&cell, "left", top, -0.0195);
        let inside = over(&cell, "left", top, -0.0055);
        let free = go(&mut cell, "left", &above, 60).pop().unwrap();
        let pressed = go(&mut cell, "left", &inside, 90);
        let back = go(&mut cell, "left", &above, 60).pop().unwrap();
        let last = &pressed[90..];
        let force = |r: &CellReport| r.arms[0].contact.length();
        let mean = last.iter().map(force).sum::<f64>() / last.len() as f64;
        let swing = last.iter().map(|r| (force(r) - mean).abs()).fold(0.0, f64::max);
        let peak = pressed.iter().map(force).fold(0.0, f64::max);
        let [a, c] = [&free, &back].map(|r| r.arms[0].rcm_deviation * 1e3);
        assert!(mean > 0.02, "it presses: {mean} N at {young_modulus_pa} Pa");
        assert!(swing < 0.03 * mean + 0.01, "it swings by {swing} N around {mean} N at {young_modulus_pa} Pa");
        assert!(peak < 1.3 * mean + 0.1, "a peak of {peak} N, then {mean} N");
        assert!(back.arms[0].contact.length() < 1e-6, "free again");
        assert!(c < a + 0.1, "the shaft comes back: {a} mm before, {c} mm after");
    }
}

#[test]
fn a_load_aside_leans_the_shaft_in_its_port() {
    // A tube pinned at its lower half and as stiff as cartilage, pushed aside with the closed
    // blades.
    let mut specimen = two_tubes(Pins::Band { share: 0.42 }, 3e-3);
    specimen.organs[0].material.young_modulus_pa = 1e6;
    let mut cell = cell(&specimen);
    cell.servo_jaw("left", 0.0).unwrap();
    let beside = DVec3::new(0.0, 0.46 - 0.0105, 0.045);
    let free = over(&cell, "left", beside, -0.006);
    let pushed = over(&cell, "left", beside + DVec3::new(0.0, 0.005, 0.0), -0.006);
    let high = over(&cell, "left", beside + DVec3::new(0.0, 0.0, 0.02), -0.006);
    go(&mut cell, "left", &high, 60);
    let before = go(&mut cell, "left", &free, 60).pop().unwrap();
    let under = go(&mut cell, "left", &pushed, 60).pop().unwrap();
    let after = go(&mut cell, "left", &free, 60).pop().unwrap();
    let tip = |r: &CellReport| {
        let arm = &r.arms[0];
        cell.workspace("left").unwrap().tip(&arm.commanded).translation.distance(arm.tip.translation) * 1e3
    };
    let rcm = |r: &CellReport| r.arms[0].rcm_deviation * 1e3;
    let load = under.arms[0].contact.length();
    assert!(load > 0.3, "{load} N");
    assert!(tip(&under) > tip(&before) || rcm(&under) > rcm(&before), "a loaded tip gives way");
    assert!(rcm(&under) < 3.0 && rcm(&after) < rcm(&before) + 0.1 && tip(&after) < tip(&before) + 0.2);
}

#[test]
fn joints_can_be_commanded_and_orientations_that_cannot_be_met_are_told() {
    let mut cell = cell(&meshed(ONE_END, 4e-3));
    let mut q: Vec<f64> = cell.measured_js("right").unwrap().position.iter().copied().collect();
    q[6] += 0.1;
    cell.servo_jp("right", &q).unwrap();
    for _ in 0..45 {
        cell.step(None).unwrap();
    }
    let now = cell.measured_js("right").unwrap().position;
    assert!((now[6] - q[6]).abs() < 5e-3, "{} of {}", now[6], q[6]);
    let mut tip = cell.measured_cp("left").unwrap();
    tip.rotation = DQuat::from_rotation_y(0.2) * tip.rotation;
    let solution = cell.servo_cp("left", &tip).unwrap();
    assert!((solution.rejected_rotation.length() - 0.2).abs() < 0.02, "{}", solution.rejected_rotation);
    let report = cell.step(None).unwrap();
    assert_eq!(report.arms[0].rejected_rotation, solution.rejected_rotation);
}

#[test]
fn scenes_that_do_not_fit_are_named() {
    let specimen = meshed(ONE_END, 4e-3);
    let said = |change: &dyn Fn(&mut trocar_scene::Scene)| {
        let mut scene = scene();
        change(&mut scene);
        Cell::new(&scene, &specimen, 1).err().unwrap().to_string()
    };
    assert!(said(&|s| s.rates.control_hz = 50).contains("rates.control_hz"));
    assert!(said(&|s| s.rates.physics_hz = 90).contains("rates.physics_hz"));
    assert!(said(&|s| s.tissue.filtered_pairs.push(["tube".into(), "liver".into()])).contains("liver"));
    assert!(
        said(&|s| {
            s.organs.insert("liver".into(), Default::default());
        })
        .contains("organ.liver")
    );
    assert!(said(&|s| s.arms[1].controller.name = "fuzzy".into()).contains("fuzzy"));
    assert!(said(&|s| s.arms[0].start.insertion_mm = 180.0).contains("insertion"));
}
