//! Instruments push each other, the bed and tissue that cannot move.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{close, shift};
use glam::{DMat3, DQuat, DVec3};
use trocar_cell::{Action, Cell, CellEvent, CellReport, Setpoint};
use trocar_core::Pose;
use trocar_scene::{Arm, Drive, Scene, Side};
use trocar_specimen::{Pins, Specimen};
use trocar_testing::tube::{ONE_END, RADIUS, meshed, scene, two_tubes};

/// The coarse tubes, 25 mm behind where instruments cross in these tests.
fn aside() -> (Scene, Specimen) {
    let mut scene = scene();
    scene.placement.position_m[1] += 0.04;
    (scene, two_tubes(ONE_END, 4e-3))
}

fn rest(cell: &mut Cell, periods: usize) -> Vec<CellReport> {
    (0..periods).map(|_| cell.step(None).unwrap()).collect()
}

fn most(reports: &[CellReport], of: impl Fn(&CellReport) -> f64) -> f64 {
    reports.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// Closes all jaws, raises the left tip by 20 mm and moves it by 60 mm at 0.1 m/s, through where
/// the right shaft is.
fn cross(cell: &mut Cell) -> Vec<CellReport> {
    close(cell, 15);
    shift(cell, "left", 0.02 * DVec3::Z, 15);
    shift(cell, "left", 0.06 * DVec3::X, 18)
}

#[test]
fn arms_that_cross_push_each_other_and_the_guard_holds_them() {
    let (scene, specimen) = aside();
    let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
    assert!(cell.clearance() > 0.01);
    let mut all = cross(&mut cell);
    all.extend(rest(&mut cell, 120));
    let unequal = most(&all, |r| (r.arms[0].solid + r.arms[1].solid).length());
    assert!(unequal < 1e-9, "action is reaction: {unequal} N");
    let (peak, deep) = (most(&all, |r| r.arms[0].solid_peak), most(&all, |r| -r.clearance));
    let rcm = most(&all, |r| r.arms[0].rcm_peak.max(r.arms[1].rcm_peak));
    let last = all.last().unwrap();
    let rests = &all[all.len() - 30..];
    let held = rests.iter().map(|r| r.arms[0].solid.length()).sum::<f64>() / rests.len() as f64;
    println!("crossing: peak {peak:.1} N, rest {held:.1} N, {:.2} mm deep, RCM {:.3} mm", 1e3 * deep, 1e3 * rcm);
    assert!(peak > 5.0 && peak < 30.0 && deep < 2.5e-3, "{peak} N, {deep} m");
    assert!(held > 5.0 && held < 13.0 && last.arms[0].guarded, "{held} N");
    assert!(last.arms[0].solid.x < 0.0 && last.clearance < 0.0, "it has not passed");
    assert!(rcm < 1e-3, "{rcm} m");
    let touches = all.iter().flat_map(|r| &r.events).filter(|e| matches!(e, CellEvent::InstrumentsTouch { .. }));
    assert!(touches.count() > 0);
    // They part without a trace.
    let back = shift(&mut cell, "left", -0.06 * DVec3::X, 45);
    let gone = back.last().unwrap();
    assert!(gone.clearance > 0.01 && gone.arms.iter().all(|a| a.solid == DVec3::ZERO && a.solid_peak == 0.0));
}

#[test]
fn no_arm_passes_the_other_without_the_guard() {
    let (mut scene, specimen) = aside();
    scene.safety.rules.force_guard = false;
    let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
    let mut all = cross(&mut cell);
    all.extend(rest(&mut cell, 60));
    let (peak, deep) = (most(&all, |r| r.arms[0].solid_peak), most(&all, |r| -r.clearance));
    println!("without the guard: peak {peak:.1} N, {:.2} mm deep", 1e3 * deep);
    assert!(deep < 3.2e-3 && all.last().unwrap().arms[0].solid.x < 0.0, "{deep} m");
    assert!(peak > 20.0 && peak < 300.0, "{peak} N");
}

#[test]
fn a_state_in_which_instruments_push_goes_on_to_the_bit() {
    let (scene, specimen) = aside();
    let mut one = Cell::new(&scene, &specimen, 1).unwrap();
    let mut two = Cell::new(&scene, &specimen, 2).unwrap();
    let (first, second) = (cross(&mut one), cross(&mut two));
    assert!(first.last().unwrap().arms[0].solid_peak > 1.0);
    assert_eq!((one.hash(), first), (two.hash(), second), "threads do not matter");
    let saved = one.save();
    let later = (rest(&mut one, 8), one.hash());
    one.restore(&saved).unwrap();
    assert_eq!((rest(&mut one, 8), one.hash()), later);
    let mut new = Cell::new(&scene, &specimen, 1).unwrap();
    new.restore(&saved).unwrap();
    assert_eq!((rest(&mut new, 8), new.hash()), later);
}

/// Two free ideal arms, side by side over the tubes.
fn free() -> (Scene, Specimen) {
    let (mut scene, specimen) = aside();
    scene.arms = vec![
        Arm::free(Side::Left, "grasper", [-0.02, 0.44, 0.12]),
        Arm::free(Side::Right, "cutter", [0.02, 0.44, 0.12]),
    ];
    (scene, specimen)
}

#[test]
fn ideal_arms_stop_where_solids_push_with_the_force_limit() {
    let (mut scene, specimen) = free();
    // The guard would shorten the command before.
    scene.safety.rules.force_guard = false;
    let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
    let limit = scene.safety.force_limit_n;
    let all = cross(&mut cell);
    let last = all.last().unwrap();
    let force = last.arms[0].solid.length();
    assert!(most(&all, |r| r.arms[0].solid_peak) <= limit + 1e-9 && force > 0.9 * limit, "{force} N");
    assert!((last.arms[0].solid + last.arms[1].solid).length() < 1e-9 && last.arms[0].held_back);
    assert!(last.clearance < -4e-4 && last.clearance > -1.1e-3, "{} m", last.clearance);
}

#[test]
fn a_command_that_runs_far_ahead_takes_no_ideal_arm_through_a_solid() {
    let mut scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.arms = vec![Arm::free(Side::Left, "grasper", [0.0, 0.46, 0.12])];
    scene.instruments.truncate(1);
    scene.safety.rules.force_guard = false;
    let mut cell = Cell::new(&scene, &meshed(Pins::Band { share: 1.0 }, 2.2e-3), 1).unwrap();
    close(&mut cell, 15);
    // The blades' tips are 0.1 m above the floor; the command goes to 0.08 m below it.
    let all = shift(&mut cell, "left", -0.18 * DVec3::Z, 60);
    let last = all.last().unwrap();
    let (force, tip) = (last.arms[0].solid, last.arms[0].tip.translation.z - 0.021);
    assert!(
        force.z > 0.9 * scene.safety.force_limit_n && force.length() <= scene.safety.force_limit_n + 1e-9,
        "{force}"
    );
    assert!((tip - TUBE_TOP).abs() < 1.5e-3, "{tip} m");
}

/// The top of the tube of `scene` (m).
const TUBE_TOP: f64 = 0.045 + 0.0045;

#[test]
fn the_bed_stops_joint_commands_which_know_no_floor() {
    let (scene, high) = aside();
    let mut low = high.clone();
    // The camera looks down: this is 30 mm lower.
    for organ in &mut low.organs {
        organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices).for_each(|p| p.z += 0.03);
        organ.base.z += 0.03;
    }
    let mut cell = Cell::new(&scene, &low, 1).unwrap();
    close(&mut cell, 15);
    let open = Cell::new(&scene, &high, 1).unwrap();
    let floor = specimen_floor(&open);
    let tip = cell.measured_cp("left").unwrap();
    let along = tip.rotation * DVec3::X;
    let to = (tip.translation.z + 0.021 * along.z - floor + 0.005) / -along.z;
    shift(&mut cell, "left", to * along, 60);
    rest(&mut cell, 15);
    let joints = cell.measured_js("left").unwrap().position;

    let mut cell = Cell::new(&scene, &high, 1).unwrap();
    close(&mut cell, 15);
    let from = cell.measured_js("left").unwrap().position;
    for k in 1..=60 {
        let share = f64::from(k) / 60.0;
        let now: Vec<f64> = (0..7).map(|i| from[i] + share * (joints[i] - from[i])).collect();
        cell.servo_jp("left", &now).unwrap();
        cell.step(None).unwrap();
    }
    let all = rest(&mut cell, 60);
    let arm = &all.last().unwrap().arms[0];
    let depth = floor - arm.tip.transform(0.021 * DVec3::X).z;
    println!("5 mm into the bed by joints: {:.1} N, {:.2} mm deep", arm.solid.length(), 1e3 * depth);
    assert!(arm.solid.z > 5.0 && arm.solid.z < 120.0 && arm.solid.truncate().length() < 1e-9, "{}", arm.solid);
    assert!(depth > 0.0 && depth < 1.6e-3, "{depth} m");
    assert_eq!(arm.contact, DVec3::ZERO);
}

/// Height of the lowest node (m).
fn specimen_floor(cell: &Cell) -> f64 {
    let world = cell.world();
    let nodes = world.model.bodies().iter().enumerate().flat_map(|(k, b)| (0..b.len()).map(move |i| (k, i)));
    nodes.map(|(k, i)| world.state.position(&world.model, k, i).z).fold(f64::INFINITY, f64::min)
}

#[test]
fn tissue_that_cannot_move_stops_instruments_at_its_surface() {
    let mut of_tube = scene();
    of_tube.task.organ = "tube".to_owned();
    let fixed = meshed(Pins::Band { share: 1.0 }, 2.2e-3);
    for (name, ideal) in [("dynamic", false), ("ideal", true)] {
        let mut scene = of_tube.clone();
        if ideal {
            scene.arms.iter_mut().for_each(|arm| (arm.drive, arm.base) = (Drive::Ideal, None));
        }
        let mut cell = Cell::new(&scene, &fixed, 1).unwrap();
        let (k, jaw) = (0, 0.0);
        // Closed blades straight above the tube's middle, then down by 25 mm.
        let from = cell.measured_cp("left").unwrap();
        let above = DVec3::new(0.0, 0.46, TUBE_TOP + 0.021 + 0.01);
        let start = cell.setpoint("left").unwrap();
        let close = cell.solve("left", &Pose { translation: above, ..from }, &start).unwrap().setpoint.with_jaw(jaw);
        let mut targets: Vec<Setpoint> = cell.observe().iter().map(|a| a.commanded).collect();
        targets[k] = close;
        for _ in 0..45 {
            cell.step(&Action::targets(&targets)).unwrap();
        }
        let mut all = shift(&mut cell, "left", -0.025 * DVec3::Z, 60);
        all.extend(rest(&mut cell, 60));
        let last = all.last().unwrap();
        let arm = &last.arms[0];
        let tip = arm.tip.transform(0.021 * DVec3::X);
        let rests = &all[all.len() - 30..];
        let mean = rests.iter().map(|r| r.arms[0].solid.z).sum::<f64>() / rests.len() as f64;
        let (peak, rcm) = (most(&all, |r| r.arms[0].solid_peak), most(&all, |r| r.arms[0].rcm_peak));
        println!(
            "{name} on pinned tissue: peak {peak:.1} N, rest {mean:.1} N, blades {:.2} mm above its top, RCM {:.3} mm",
            1e3 * (tip.z - TUBE_TOP),
            1e3 * rcm
        );
        assert!(mean > 4.0 && mean < 16.0 && peak < 25.0, "{name}: {mean} N, {peak} N");
        assert!((tip.z - TUBE_TOP).abs() < 1.5e-3, "{name}: {} m", tip.z - TUBE_TOP);
        assert_eq!(arm.contact, DVec3::ZERO, "{name}: what cannot move has no contact of tissue");
        assert!(rcm < 1e-3, "{name}: {rcm} m");
    }
}

#[test]
fn jaws_open_until_pinned_tissue_holds_them() {
    let mut scene = scene();
    scene.task.organ = "tube".to_owned();
    let fixed = meshed(Pins::Band { share: 1.0 }, 2.2e-3);
    let mut cell = Cell::new(&scene, &fixed, 1).unwrap();
    // Closed blades beside the tube, 0.8 mm from it, which open towards it and away from it.
    let place = |height: f64| DVec3::new(0.0, 0.46 + RADIUS + 4e-3, TUBE_TOP - RADIUS + 0.0205 + height);
    let rotation = DQuat::from_mat3(&DMat3::from_cols(-DVec3::Z, -DVec3::Y, -DVec3::X));
    let mut targets: Vec<Setpoint> = cell.observe().iter().map(|a| a.commanded).collect();
    let mut go = |cell: &mut Cell, height: f64, jaw: f64, periods: usize| -> Vec<CellReport> {
        let pose = Pose { rotation, translation: place(height) };
        targets[0] = cell.solve("left", &pose, &targets[0]).unwrap().setpoint.with_jaw(jaw);
        (0..periods).map(|_| cell.step(&Action::targets(&targets)).unwrap()).collect()
    };
    go(&mut cell, 0.03, 0.0, 60);
    let before = go(&mut cell, 0.0, 0.0, 60);
    assert!(most(&before, |r| r.arms[0].solid_peak) == 0.0, "the closed jaws are free");
    let opened = go(&mut cell, 0.0, 1.0, 45);
    let last = &opened.last().unwrap().arms[0];
    let peak = most(&opened, |r| r.arms[0].solid_peak);
    println!("jaws open to {:.2} beside a solid; peak {peak:.2} N", last.measured.jaw());
    assert!(last.measured.jaw() > 0.02 && last.measured.jaw() < 0.5, "{}", last.measured.jaw());
    assert!(peak > 0.1 && peak < 3.0, "{peak} N");
    // They close again, and in the open they open whole.
    go(&mut cell, 0.0, 0.0, 20);
    go(&mut cell, 0.03, 0.0, 45);
    let free = go(&mut cell, 0.03, 1.0, 45);
    assert!(free.last().unwrap().arms[0].measured.jaw() > 0.99);
}

#[test]
fn a_start_in_an_organ_is_drawn_back_along_the_shaft() {
    let fixed = Pins::Band { share: 1.0 };
    for (pins, free, lean) in [(fixed, false, 0.0), (ONE_END, false, 0.0), (ONE_END, true, 0.0), (fixed, true, 1.2)] {
        let specimen = meshed(pins, 2.2e-3);
        let mut scene = scene();
        scene.task.organ = "tube".to_owned();
        // The blades are thick.
        scene.tissue.tip_rest_offset_mm = 3.5;
        if free {
            let mut arm = Arm::free(Side::Left, "grasper", [0.0, 0.46 + 0.1 * lean, 0.12]);
            arm.direction = Some([0.0, -libm::sin(lean), -libm::cos(lean)]);
            scene.arms = vec![arm];
            scene.instruments.truncate(1);
        }
        let outside = Cell::new(&scene, &specimen, 1).unwrap();
        // The closed blades' tips below the middle of the tube.
        let tip = outside.measured_cp("left").unwrap();
        let along = tip.rotation * DVec3::X;
        let translation = DVec3::new(0.0, 0.46, TUBE_TOP - 1.6 * RADIUS) - 0.021 * along;
        let near = outside.setpoint("left").unwrap();
        let inside = outside.solve("left", &Pose { translation, ..tip }, &near).unwrap().setpoint.with_jaw(0.0);
        let mut starts: Vec<Setpoint> = outside.observe().iter().map(|a| a.commanded).collect();
        starts[0] = inside;
        let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
        cell.restart(&outside.save(), &starts).unwrap();
        let now = &cell.observe()[0];
        let space = cell.workspace("left").unwrap();
        let way = now.tip.translation - space.tip(&inside).translation;
        println!("drawn back by {:.1} mm", 1e3 * way.length());
        assert!(way.length() > 0.004 && way.length() < 0.03, "by {way} m");
        assert!(way.normalize().distance(-(space.tip(&inside).rotation * DVec3::X)) < 0.02, "along the shaft");
        let start = now.commanded;
        let reports = rest(&mut cell, 10);
        assert!(reports.iter().all(|r| r.rules.pierced == 0) && !cell.axes_inside()[0]);
        let (solid, soft) = (most(&reports, |r| r.arms[0].solid_peak), most(&reports, |r| r.arms[0].contact.length()));
        assert!(solid == 0.0 && soft < 0.05, "the organ pushes it with {solid} and {soft} N");
        // The next restart knows nothing of this one, and a start outside stays.
        let mut again = Cell::new(&scene, &specimen, 1).unwrap();
        again.restart(&outside.save(), &starts).unwrap();
        cell.restart(&outside.save(), &starts).unwrap();
        assert_eq!(cell.hash(), again.hash());
        starts[0] = start;
        cell.restart(&outside.save(), &starts).unwrap();
        assert_eq!(cell.observe()[0].commanded, start);
    }
}

#[test]
fn a_scene_whose_start_is_in_an_organ_begins_out_of_it() {
    let specimen = meshed(Pins::Band { share: 1.0 }, 2.2e-3);
    let mut scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.instruments.truncate(1);
    scene.arms = vec![Arm::free(Side::Left, "grasper", [0.0, 0.46, TUBE_TOP + 0.016])];
    scene.arms[0].start.jaw = 0.0;
    let cell = Cell::new(&scene, &specimen, 1).unwrap();
    let arm = &cell.observe()[0];
    assert!(!cell.axes_inside()[0] && arm.commanded.0[2] > TUBE_TOP + 0.02);
    assert_eq!((arm.measured, arm.tip.translation.z), (arm.commanded, arm.commanded.0[2]));
}
