//! A scripted lift of a tube alone by an ideal arm: the four ways to hold, a grasp after a drag, a
//! cut, and the options.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use trocar_scene::GraspDesignName;
use trocar_specimen::Pins;
use trocar_task::policy::{AfterHold, CutAt, Script, Scripted};
use trocar_task::{Episode, Recording, Severed, Summary, run};
use trocar_testing::tube::{ONE_END, specimen};
use trocar_workflow::specimen_scene::free_scene;
use trocar_workflow::{Lift, Result};

fn lift(lift: &Lift, pins: Pins) -> Result<Recording> {
    lift.script.check()?;
    let specimen = specimen(pins);
    let sever = matches!(lift.script.after, AfterHold::Cut(_));
    // A scene names a specimen's folder.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tube");
    specimen.write(&path).unwrap();
    let scene = lift.arrange(free_scene(&specimen, &path, "tube", sever)?)?;
    let mut episode = Episode::new(&scene, &specimen, lift.threads)?;
    Ok(run(&mut episode, &mut Scripted::following(lift.script), 0, &mut |_| true)?)
}

fn script(script: Script, design: GraspDesignName) -> Lift {
    Lift { script, design: Some(design), threads: 1, ..Lift::default() }
}

fn cut(cut: CutAt, at: f64, threads: usize, pins: Pins) -> Summary {
    let script = Script { at, after: AfterHold::Cut(cut), ..Script::default() };
    lift(&Lift { script, threads, ..Lift::default() }, pins).unwrap().summary
}

#[test]
fn a_grasped_tube_follows_the_jaws() {
    for pins in [ONE_END, Pins::Band { share: 0.42 }] {
        let recording = lift(&script(Script::default(), GraspDesignName::LivePose), pins).unwrap();
        let (s, d) = (&recording.summary, &recording.summary.details);
        assert!(s.held && s.passed && !s.diverged && d.settling.settled, "{s:?}");
        // The lift stretches an edge at the jaws five times, which is counted.
        assert!(s.warnings.pierced == 0 && s.warnings.folded == 0, "{s:?}");
        assert!(s.attached && d.gap_mm.unwrap() > 1.5, "{s:?}");
        assert!((s.lift_mm.unwrap() - 15.0).abs() < 0.2 && s.slip_mm.is_some_and(|slip| slip < 0.01), "{s:?}");
        assert_eq!(d.snap_mm, Some(0.0), "live-pose capture does not move the tissue");
        let step = d.activation_step_mm.unwrap();
        assert!(step > 0.0 && step < 0.5, "{step} mm");
        assert!(d.pin_drift_mm < 1e-4, "{}", d.pin_drift_mm);
        assert_eq!((d.inverted_rest, s.inverted_peak), (0, 0));
    }
}

#[test]
fn released_tissue_comes_back_down() {
    let recording = lift(&Lift::default(), ONE_END).unwrap();
    let last = recording.channels.last().unwrap();
    assert!(recording.summary.held && last.task.grasped == 0.0);
    assert!(last.task.lift_mm.abs() < 2.0, "{} mm above where it was grasped", last.task.lift_mm);
}

#[test]
fn jaws_that_press_hold_by_friction_and_compliantly() {
    for design in [GraspDesignName::Friction, GraspDesignName::Compliant] {
        let s = lift(&script(Script::default(), design), ONE_END).unwrap().summary;
        assert!(s.held && s.torn == 0 && !s.diverged && s.inverted_peak == 0, "{s:?}");
        assert!(s.details.closing_force_n.unwrap() > 0.45 && s.details.snap_mm == Some(0.0), "{s:?}");
        let loose = Lift { jaw_force: Some(0.02), ..script(Script::default(), design) };
        let s = lift(&loose, ONE_END).unwrap().summary;
        assert!(!s.held, "{design:?}: jaws that hardly press hold nothing");
        let why = s.why.unwrap();
        assert!(!why.contains('\n'), "{why}");
    }
}

#[test]
fn displacement_since_rest_is_the_snap_of_a_rest_pose_grasp_alone() {
    let grasp = |design| {
        let dragged = Script { regrasp: Some(0.003), ..Script::default() };
        lift(&script(dragged, design), ONE_END).unwrap().summary.details
    };
    let (rest, live) = (grasp(GraspDesignName::RestPose), grasp(GraspDesignName::LivePose));
    assert!((rest.snap_mean_mm.unwrap() - rest.displaced_mm.unwrap()).abs() < 0.01, "equation (5): {rest:?}");
    assert_eq!((live.snap_mm, live.snap_mean_mm), (Some(0.0), Some(0.0)));
    assert!(
        (rest.displaced_mm.unwrap() - live.displaced_mm.unwrap()).abs() < 1e-9,
        "the same state before the second grasp"
    );
    assert!(rest.activation_step_mm > live.activation_step_mm, "{rest:?} {live:?}");
}

#[test]
fn the_piece_that_is_cut_off_stays_in_the_jaws_and_the_stump_stays_behind() {
    let s = cut(CutAt::Between, 0.75, 1, ONE_END);
    let Severed { cut: c, held, held_rise_mm, inverted_peak, .. } = s.details.sever.as_ref().unwrap();
    assert_eq!((c.outcome.as_str(), c.pieces.len()), ("severed", 2), "{c:?}");
    assert!(c.opened_rad > 0.5 && c.closed_rad < 0.15 && c.between_blades_mm3 > 100.0, "{c:?}");
    assert!((0.2..0.7).contains(&c.at) && c.at_least < c.at_most, "{c:?}");
    assert!(c.volume_error < 1e-6 && c.inverted_after == 0 && *inverted_peak == 0, "{c:?}");
    // Its section is a disc of 9 mm, of faces that zigzag.
    assert!((60.0..160.0).contains(&c.area_mm2), "{c:?}");
    let [stump, loose] = &c.pieces[..] else { panic!("{c:?}") };
    assert!(stump.pinned > 0 && stump.held == 0 && loose.pinned == 0 && loose.held > 0, "{c:?}");
    assert_eq!((stump.name.as_str(), loose.name.as_str()), ("tube", "tube.1"));
    let whole = specimen(ONE_END).organs[0].body.clone();
    assert_eq!(stump.elements + loose.elements, whole.tets.len());
    assert_eq!(stump.nodes + loose.nodes, whole.vertices.len() + c.copies);
    assert!(*held && *held_rise_mm > 8.0 && loose.rise_mm > 5.0 && stump.rise_mm < 1.0, "{s:?}");
    // The same bits on two threads.
    assert_eq!(cut(CutAt::Between, 0.75, 2, ONE_END).details, s.details);
}

#[test]
fn a_cut_at_the_tip_takes_the_tip_and_one_that_frees_nothing_says_so() {
    let s = cut(CutAt::S(1.0), 0.5, 1, ONE_END).details.sever.unwrap();
    assert!(s.cut.at > 0.9 && s.cut.pieces.len() == 2 && s.held, "{s:?}");
    let [stump, tip] = &s.cut.pieces[..] else { panic!("{s:?}") };
    assert!(stump.held > 0 && tip.held == 0 && tip.pinned == 0, "{s:?}");
    assert!(tip.volume_after_mm3 < 0.02 * stump.volume_after_mm3 && tip.rise_mm < 0.0, "the tip falls: {s:?}");
    let both = cut(CutAt::Between, 0.6, 1, Pins::Band { share: 0.42 }).details.sever.unwrap();
    assert!(both.cut.said.contains("both sides are pinned") && both.cut.pieces.iter().all(|p| p.pinned > 0));
    // Without a cut there is nothing to say of one.
    assert!(lift(&Lift::default(), ONE_END).unwrap().summary.details.sever.is_none());
}

#[test]
fn options_out_of_range_are_named() {
    let refused = |change: fn(&mut Lift)| {
        let mut task = Lift::default();
        change(&mut task);
        lift(&task, ONE_END).map(|r| r.summary).unwrap_err().to_string()
    };
    assert!(refused(|l| l.script.at = 1.5).contains("--at"));
    assert!(refused(|l| l.script.lift = f64::NAN).contains("--lift"));
    assert!(refused(|l| l.script.approach_offset = 1.0).contains("--approach-offset"));
    assert!(refused(|l| l.script.regrasp = Some(f64::NAN)).contains("--regrasp"));
    assert!(refused(|l| l.script.after = AfterHold::Cut(CutAt::S(f64::NAN))).contains("--sever"));
    let jaw = refused(|l| l.jaw_force = Some(0.0));
    assert!(jaw.contains("--jaw-force"), "{jaw}");
    let other = free_scene(&specimen(ONE_END), "tube".as_ref(), "liver", false).unwrap_err().to_string();
    assert!(other.contains("liver") && other.contains("tube"), "{other}");
    let pinned = lift(&Lift::default(), Pins::Band { share: 1.0 }).unwrap().summary;
    assert!(!pinned.passed && format!("{:?}", pinned.end).contains("all are pinned"), "{pinned:?}");
}
