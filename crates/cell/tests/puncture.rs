//! An instrument that presses hard enough on an organ punctures it.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{close, shift};
use glam::DVec3;
use trocar_cell::{Cell, CellEvent, CellReport};
use trocar_scene::{Arm, Scene, Side};
use trocar_specimen::Pins;
use trocar_testing::tube::{ONE_END, meshed, scene};

/// Height of the middle of the tube, which lies on its bed (m).
const TUBE_HEIGHT: f64 = 0.045;
/// Distance of the blades' tips from the tip frame (m).
const BLADE: f64 = 0.021;
/// Through the tube into its bed (m), in a third of a second: it crushes the tube within a few
/// frames. Slower, the tube becomes flat, and the rule against overstretch acts before.
const THROUGH: DVec3 = DVec3::new(0.0, 0.0, -0.026);
const FAST: usize = 10;

/// The tube below one free ideal arm, with its blades' tips 10 mm above it. Nothing but tissue
/// stops it.
fn above(puncture_force_n: f64) -> Cell {
    above_tube(puncture_force_n, 10.0, ONE_END)
}

/// The same with the force with which solids stop the arm (N), and with pins.
fn above_tube(puncture_force_n: f64, force_limit_n: f64, pins: Pins) -> Cell {
    let mut scene: Scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.arms = vec![Arm::free(Side::Left, "grasper", [0.0, 0.46, TUBE_HEIGHT + BLADE + 0.015])];
    scene.instruments.truncate(1);
    scene.safety.rules.force_guard = false;
    scene.safety.puncture_force_n = puncture_force_n;
    scene.safety.force_limit_n = force_limit_n;
    let mut cell = Cell::new(&scene, &meshed(pins, 2.2e-3), 1).unwrap();
    close(&mut cell, 30);
    cell
}

/// The forces of punctures (N).
fn punctures(reports: &[CellReport]) -> Vec<f64> {
    let events = reports.iter().flat_map(|r| &r.events);
    let force = |event: &CellEvent| match event {
        CellEvent::Punctured { arm: Side::Left, organ, force_n, .. } if organ == "tube" => Some(*force_n),
        _ => None,
    };
    events.filter_map(force).collect()
}

fn pierced(reports: &[CellReport]) -> usize {
    reports.iter().map(|r| r.rules.pierced).sum()
}

/// The largest force of tissue on the instrument (N).
fn force(reports: &[CellReport]) -> f64 {
    reports.iter().map(|r| r.arms[0].contact.length()).fold(0.0, f64::max)
}

#[test]
fn a_rod_that_presses_hard_enough_punctures_a_thin_organ_once() {
    let threshold = 10.0;
    let mut cell = above(threshold);
    let down = shift(&mut cell, "left", THROUGH, FAST);
    let forces = punctures(&down);
    assert!(forces.len() == 1 && forces[0] >= threshold, "{forces:?} N");
    assert_eq!(down.iter().map(|r| r.rules.punctures).sum::<usize>(), 1);
    assert_eq!(pierced(&down), 0);
    assert_eq!(cell.punctured_by(0), [0]);
    assert_eq!(cell.axes_inside(), [false], "an axis in a hole is not counted");

    // In the hole nothing punctures again, and the instrument slides without a load.
    let on = shift(&mut cell, "left", -0.003 * DVec3::Z, 20);
    assert!(punctures(&on).is_empty() && cell.punctured_by(0) == [0]);

    // The same bits after a restore in the hole, also in another cell.
    let saved = cell.save();
    let later = (shift(&mut cell, "left", 0.002 * DVec3::Z, 8), cell.hash());
    cell.restore(&saved).unwrap();
    assert_eq!((shift(&mut cell, "left", 0.002 * DVec3::Z, 8), cell.hash()), later);
    let mut other = above(threshold);
    other.restore(&saved).unwrap();
    assert_eq!((shift(&mut other, "left", 0.002 * DVec3::Z, 8), other.hash()), later);

    // Out of it the hole is gone, and tissue touches the instrument as before.
    let out = shift(&mut cell, "left", 0.03 * DVec3::Z, 60);
    assert!(cell.punctured_by(0).is_empty() && punctures(&out).is_empty());
    assert_eq!(force(&out[50..]), 0.0);
    let again = shift(&mut cell, "left", -0.0155 * DVec3::Z, 60);
    assert!(force(&again) > 0.05, "{} N", force(&again));
    assert!(punctures(&again).is_empty() && cell.axes_inside() == [false], "it lies on the surface");
}

#[test]
fn below_the_threshold_nothing_is_punctured() {
    let mut cell = above(1000.0);
    let down = shift(&mut cell, "left", THROUGH, FAST);
    assert!(force(&down) > 5.0, "it presses as hard as in the other test: {} N", force(&down));
    assert!(punctures(&down).is_empty() && cell.punctured_by(0).is_empty());
    assert!(pierced(&down) > 0 && cell.pierces("left").unwrap(), "it is counted instead");
}

/// No contact of the tissue's step tells that an instrument is in tissue of which no node moves.
#[test]
fn an_instrument_in_tissue_that_cannot_move_is_noticed_until_it_is_out() {
    for (threshold, punctured) in [(10.0, true), (1000.0, false)] {
        let mut cell = above_tube(threshold, 1000.0, Pins::Band { share: 1.0 });
        let down = shift(&mut cell, "left", -0.018 * DVec3::Z, 4);
        let found = (punctures(&down).len(), pierced(&down));
        println!("threshold {threshold} N: {found:?}");
        assert_eq!(found, if punctured { (1, 0) } else { (0, 1) });
        assert_eq!(cell.punctured_by(0).is_empty(), !punctured);
        assert_eq!((cell.axes_inside()[0], cell.pierces("left").unwrap()), (!punctured, !punctured));
        let out = shift(&mut cell, "left", 0.03 * DVec3::Z, 30);
        assert!(punctures(&out).is_empty() && pierced(&out) == 0);
        assert!(cell.punctured_by(0).is_empty() && !cell.pierces("left").unwrap() && !cell.axes_inside()[0]);
    }
}
