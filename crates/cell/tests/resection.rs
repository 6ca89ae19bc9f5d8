//! A grasped tube that is lifted and cut: the piece in the jaws goes with them, the stump stays.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod common;

use common::{ONE_END, specimen};
use trocar_cell::{GraspDesign, GraspLift, GraspLiftRun, SeverAt};
use trocar_core::Silent;
use trocar_specimen::Pins;

fn run(sever: SeverAt, at: f64, threads: usize, pins: Pins) -> GraspLiftRun {
    let task = GraspLift { sever: Some(sever), at, threads, snapshot_every: 10, ..GraspLift::default() };
    task.run(&specimen(pins), &Silent).unwrap()
}

#[test]
fn what_is_cut_off_stays_in_the_jaws_and_the_stump_stays_behind() {
    let run = run(SeverAt::Between, 0.75, 1, ONE_END);
    let s = run.summary.sever.as_ref().unwrap();
    assert_eq!((s.outcome, s.pieces.len()), ("severed", 2), "{s:?}");
    assert!(s.opened_rad > 0.50 && s.closed_rad < 0.15 && s.between_blades_mm3 > 100.0, "{s:?}");
    assert!((0.2..0.7).contains(&s.at) && (s.at - s.aimed_at).abs() < 0.05 && s.at_least < s.at_most, "{s:?}");
    assert!(s.volume_error < 1e-6 && s.inverted_after == 0 && s.inverted_peak == 0, "{s:?}");
    // Its section is a disc of 9 mm, of faces that zigzag.
    assert!((60.0..160.0).contains(&s.area_mm2), "{s:?}");
    let [stump, held] = &s.pieces[..] else { panic!("{s:?}") };
    assert!(stump.pinned > 0 && stump.held == 0 && held.pinned == 0 && held.held == run.summary.held_nodes, "{s:?}");
    assert_eq!((stump.name.as_str(), held.name.as_str()), ("tube", "tube.1"));
    assert!(stump.s_to <= s.at_most + 1e-9 && held.s_from >= s.at_least - 1e-9, "{s:?}");
    let whole = specimen(ONE_END).organs[0].body.clone();
    assert_eq!(stump.elements + held.elements, whole.tets.len());
    assert_eq!(stump.nodes + held.nodes, whole.vertices.len() + s.copies);
    assert!(s.held && s.held_rise_mm > 8.0 && held.rise_mm > 5.0 && stump.rise_mm < 1.0, "{s:?}");
    assert_eq!(run.summary.pin_drift_mm, 0.0);
    // Pictures: the same elements, each node copied from one of the specimen's.
    let cut = run.cut.unwrap();
    assert_eq!((cut.tets.len(), cut.faces.len()), (whole.tets.len(), 2 * s.faces));
    for (new, old) in cut.tets.iter().zip(&whole.tets) {
        assert_eq!(new.map(|i| cut.parents[i as usize]), *old);
    }
    let (before, after): (Vec<_>, Vec<_>) = run.snapshots.iter().partition(|s| !s.cut);
    assert!(before.iter().all(|s| s.nodes[0].len() == whole.vertices.len()) && !before.is_empty());
    assert!(after.iter().all(|s| s.nodes[0].len() == cut.parents.len() && s.cutter.is_some()) && after.len() > 5);
}

#[test]
fn a_cut_gives_the_same_bits_twice_and_for_any_threads() {
    let hash = |threads| {
        let run = run(SeverAt::Between, 0.75, threads, ONE_END).summary;
        let sever = run.sever.unwrap();
        (run.state_hash, sever.pieces, sever.at, sever.held_rise_mm)
    };
    let one = hash(1);
    assert_eq!(one, hash(1));
    assert_eq!(one, hash(2));
}

#[test]
fn without_a_cut_nothing_is_said_of_one() {
    let run = GraspLift::default().run(&specimen(ONE_END), &Silent).unwrap();
    assert!(run.summary.sever.is_none() && run.cut.is_none());
}

#[test]
fn a_cut_that_meets_nothing_or_cannot_be_says_so() {
    // No piece of four elements lies beyond the very tip.
    let nothing = run(SeverAt::S(1.0), 0.5, 1, ONE_END).summary;
    let s = nothing.sever.unwrap();
    assert_eq!((s.outcome, s.pieces.len(), s.held), ("no tissue", 0, false), "{s:?}");
    assert!(s.said.contains("nothing was cut") && s.volume_error == 0.0);
    // What is cut off beyond the grasp falls; the jaws hold what is pinned and rise no more.
    let tip = run(SeverAt::S(0.9), 0.5, 1, ONE_END).summary.sever.unwrap();
    assert_eq!((tip.outcome, tip.jaw_rise_mm), ("severed", 0.0), "{tip:?}");
    assert!(tip.pieces[0].held > 0 && tip.pieces[0].pinned > 0 && tip.pieces[1].rise_mm < -0.5, "{tip:?}");
    let out_of_range = GraspLift { sever: Some(SeverAt::S(f64::NAN)), ..GraspLift::default() };
    let said = out_of_range.run(&specimen(ONE_END), &Silent).map(|run| run.summary).unwrap_err().to_string();
    assert!(said.contains("--sever"), "{said}");
}

#[test]
fn a_cut_between_pins_says_that_both_sides_are_pinned() {
    let s = run(SeverAt::Between, 0.6, 1, Pins::Band { share: 0.42 }).summary.sever.unwrap();
    assert_eq!(s.outcome, "severed", "{s:?}");
    assert!(s.said.contains("both sides are pinned") && s.pieces.iter().all(|p| p.pinned > 0), "{s:?}");
    assert!(s.volume_error < 1e-6 && s.inverted_after == 0);
}

#[test]
fn jaws_that_slip_are_told_what_force_would_bear_the_organ() {
    let grasp = |jaw_force| {
        let design = GraspDesign::Compliant;
        let task = GraspLift { jaw_force, design, lower: false, ..GraspLift::default() };
        task.run(&specimen(ONE_END), &Silent).unwrap().summary
    };
    let weak = grasp(0.02);
    let said = weak.force_advice().unwrap();
    assert!(said.contains("--jaw-force") && said.contains("slipped"), "{said}");
    // 60 mm of 9 mm, 1200 kg/m3: 43 mN.
    assert!((0.035..0.05).contains(&weak.organ_weight_n), "{}", weak.organ_weight_n);
    assert_eq!(grasp(0.5).force_advice(), None);
}
