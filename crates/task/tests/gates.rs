//! Gates as pure functions of synthetic channels, each at its boundary; sweeps over them.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::sync::Arc;
use trocar_scene::{Gates, Program, TaskName};
use trocar_task::stages::{self, HELD_FOLLOW, HELD_SLIP_MM};
use trocar_task::{Channels, ChannelsInfo, End, GateRange, Progress, Summary, Tracker, sweep};

const PERIOD: f64 = 1.0 / 30.0;

/// Rows of a resection that just passes everything at the default gates.
fn good() -> Vec<Channels> {
    let mut rows = Vec::new();
    let mut add = |count: usize, set: &dyn Fn(&mut Channels, f64)| {
        for k in 0..count {
            let mut c = Channels { time_s: (rows.len() + 1) as f64 * PERIOD, ..Channels::default() };
            (c.task.position_mm, c.task.grasp_distance_mm, c.task.cut_jaw) = (40.0, 5.0, 0.5);
            set(&mut c, (k + 1) as f64 / count as f64);
            rows.push(c);
        }
    };
    let held = |c: &mut Channels, lift: f64| {
        (c.task.grasped, c.task.grasp_s, c.task.lift_mm, c.task.follow) = (1.0, 0.5, lift, 0.95);
    };
    add(5, &|c, share| c.task.grasp_distance_mm = 30.0 * (1.0 - share));
    add(10, &|c, share| held(c, 8.0 * share));
    add(15, &|c, _| held(c, 8.0));
    add(5, &|c, share| {
        held(c, 8.0);
        c.task.position_mm = 40.0 - 30.0 * share;
    });
    add(12, &|c, share| {
        held(c, 8.0);
        (c.task.position_mm, c.task.cut_mouth, c.task.cut_jaw) = (4.0, 1.0, 1.0 - 0.851 * share);
    });
    rows
}

fn info(task: TaskName, gates: Gates) -> ChannelsInfo {
    ChannelsInfo {
        scene: "cell-a".into(),
        task,
        gates,
        context: None,
        rcm_threshold_mm: 3.0,
        rcm_abort_mm: Some(5.0),
        arms: vec!["left".into(), "right".into()],
        policy: "none".into(),
        seed: 1,
    }
}

fn program(task: TaskName, gates: Gates) -> Arc<Program> {
    Arc::new(info(task, gates).program().unwrap())
}

fn judge(rows: &[Channels], gates: &Gates) -> Progress {
    Tracker::of(program(TaskName::AppendixResection, *gates), rows)
}

fn changed(change: impl Fn(usize, &mut Channels)) -> usize {
    let mut rows = good();
    rows.iter_mut().enumerate().for_each(|(k, c)| change(k, c));
    judge(&rows, &Gates::default()).stage
}

#[test]
fn what_just_passes_passes() {
    let progress = judge(&good(), &Gates::default());
    assert!(progress.passed() && progress.score() == 1.0, "{progress:?}");
    // Who passes the last gate as the tissue is lost, or an arm leaves its port, has not passed.
    let passed = |end: Option<End>| Summary::of(&good(), &progress, end.as_ref(), &["left"], 3.0).passed;
    assert!(passed(Some(End::Passed)) && passed(None));
    assert!(!passed(Some(End::Diverged { why: "lost".into() })));
    assert!(!passed(Some(End::RcmAbort { arm: "left".into(), deviation_mm: 6.0 })));
    let times: Vec<f64> = progress.stages.iter().map(|s| s.time_s.unwrap()).collect();
    assert!(times.windows(2).all(|w| w[0] <= w[1]), "{times:?}");
    assert!((times[0] - 6.0 * PERIOD).abs() < 1e-9, "the grasp is the first row that has one");
    // The lift is up at row 15 and has been for half a second 15 rows later.
    assert!((times[1] - 30.0 * PERIOD).abs() < 1e-9, "{times:?}");
}

#[test]
fn each_gate_stops_at_its_boundary() {
    assert_eq!(changed(|_, c| c.task.grasp_s = 0.30), 5);
    assert_eq!(changed(|_, c| c.task.grasp_s = 0.70), 5);
    assert_eq!(changed(|_, c| c.task.grasp_s = 0.299), 0);
    assert_eq!(changed(|_, c| c.task.grasp_s = 0.701), 0);
    assert_eq!(changed(|_, c| c.task.lift_mm = c.task.lift_mm.min(7.99)), 1);
    // A dip within the half second begins it anew, and then it is there too late for the rest.
    assert_eq!(changed(|k, c| c.task.lift_mm = if (22..40).contains(&k) { 7.0 } else { c.task.lift_mm }), 1);
    assert_eq!(changed(|_, c| c.task.position_mm = c.task.position_mm.max(10.0)), 5);
    assert_eq!(changed(|_, c| c.task.position_mm = c.task.position_mm.max(10.01)), 2);
    assert_eq!(changed(|_, c| c.task.cut_mouth = 0.0), 3);
    assert_eq!(changed(|_, c| c.task.cut_jaw = c.task.cut_jaw.min(0.5)), 4, "never opened beyond 0.50");
    assert_eq!(changed(|_, c| c.task.cut_jaw = c.task.cut_jaw.max(0.15)), 4, "never closed below 0.15");
    // Tissue leaves the mouth while the jaw closes.
    assert_eq!(changed(|k, c| c.task.cut_mouth *= f64::from(u8::from(k != 42))), 4);
    // ... but a mouth that is all but closed is too thin to hold any.
    assert_eq!(changed(|k, c| c.task.cut_mouth *= f64::from(u8::from(k != 46))), 5);
    // Without a grasp nothing after it counts.
    assert_eq!(changed(|k, c| c.task.grasped *= f64::from(u8::from(k < 31))), 2);
}

#[test]
fn other_tasks_have_their_own() {
    let mut rows: Vec<Channels> = Vec::new();
    for k in 1..=60 {
        let mut c = Channels { time_s: f64::from(k) * PERIOD, ..Channels::default() };
        let t = &mut c.task;
        (t.grasped, t.grasp_s, t.lift_mm, t.follow, t.slip_mm) = (1.0, 0.5, 9.0, HELD_FOLLOW, 0.99 * HELD_SLIP_MM);
        t.reach_1_mm = if k < 20 { 50.0 - 2.5 * f64::from(k) } else { 1.0 };
        (t.reach_2_mm, t.reach_3_mm) = (2.0, if k > 40 { 1.9 } else { 2.1 });
        rows.push(c);
    }
    let judged = |task, rows: &[Channels]| Tracker::of(program(task, Gates::default()), rows);
    assert!(judged(TaskName::GraspLift, &rows).passed());
    assert!(judged(TaskName::PortReach, &rows).passed());
    let mut slipped = rows.clone();
    slipped.iter_mut().for_each(|c| c.task.slip_mm = HELD_SLIP_MM);
    assert_eq!(judged(TaskName::GraspLift, &slipped).stage, 2);
    let mut left_behind = rows.clone();
    left_behind.iter_mut().for_each(|c| c.task.follow = 0.99 * HELD_FOLLOW);
    assert_eq!(judged(TaskName::GraspLift, &left_behind).stage, 2);
    assert_eq!(judged(TaskName::PortReach, &rows[..43]).stage, 2);
}

#[test]
fn shares_grow_on_the_way_and_only_what_passed_is_one() {
    let rows = good();
    let mut last = 0.0;
    let mut tracker = Tracker::new(program(TaskName::AppendixResection, Gates::default()));
    for c in &rows {
        tracker.update(c);
        let p = tracker.progress();
        assert!(p.stages.iter().all(|s| (0.0..=1.0).contains(&s.share) && (s.share == 1.0) == s.passed), "{p:?}");
        assert!(p.score() >= last - 0.08, "{} after {last}", p.score());
        last = p.score();
    }
    assert_eq!(last, 1.0);
}

#[test]
fn sweeps_agree_with_the_gates_and_refuse_what_is_none() {
    let info = info(TaskName::AppendixResection, Gates::default());
    let episodes = vec![(info.clone(), good()), (info.clone(), good()[..20].to_vec())];
    let ranges = [GateRange::parse("lift_mm=4..12").unwrap(), GateRange::parse("cut_closed=0.10,0.15,0.5").unwrap()];
    let swept = sweep(&episodes, &ranges, &mut || true).unwrap();
    assert_eq!(swept.rows.len(), 27);
    for row in &swept.rows {
        let gates = Gates { lift_mm: row.values[0], cut_closed: row.values[1], ..Gates::default() };
        let stages: Vec<usize> = episodes.iter().map(|(_, rows)| judge(rows, &gates).stage).collect();
        assert_eq!(row.stages, stages);
        assert_eq!(row.passed, stages.iter().filter(|s| **s == 5).count());
        assert_eq!(row.by_stage[0], 2);
        assert_eq!(row.passed, usize::from(row.values[0] <= 8.0 && row.values[1] >= 0.15), "{row:?}");
    }
    assert_eq!(GateRange::parse("lift_mm=4..6:0.5").unwrap().values, [4.0, 4.5, 5.0, 5.5, 6.0]);
    for bad in ["lift_mm", "lift_mm=12..4", "lift_mm=a", "lift_mm=0..1:1e-9", "lift_mm=1..inf"] {
        assert!(GateRange::parse(bad).is_err(), "{bad}");
    }
    let other = ChannelsInfo { task: TaskName::GraspLift, ..info.clone() };
    assert!(
        sweep(&[episodes[0].clone(), (other, good())], &ranges, &mut || true)
            .unwrap_err()
            .to_string()
            .contains("grasp-lift")
    );
    assert!(sweep(&[], &ranges, &mut || true).is_err());
    // Lost in the period of the last gate, which is not passed then: tissue that diverged, an arm
    // out of its port.
    let last = |change: fn(&mut Channels)| {
        let mut rows = good();
        rows.iter_mut().next_back().map(change);
        let gate = GateRange::parse("lift_mm=8").unwrap();
        sweep(&[(info.clone(), rows)], &[gate], &mut || true).unwrap().rows[0].stages[0]
    };
    assert_eq!(last(|_| ()), 5);
    assert_eq!(last(|c| c.task.diverged = 1.0), 4);
    assert_eq!(last(|c| c.right.rcm_peak_mm = 5.1), 4);
    let twice = ["lift_mm=4,8", "cut_open=0.5", "lift_mm=10"].map(|r| GateRange::parse(r).unwrap());
    assert!(sweep(&episodes, &twice, &mut || true).unwrap_err().to_string().contains("lift_mm is given twice"));
    let mut left = 5;
    let stopped = sweep(&episodes, &ranges, &mut || {
        left -= 1;
        left > 0
    });
    assert_eq!((stopped.unwrap_err().to_string(), left), (trocar_cell::Error::Interrupted.to_string(), 0));
    let mut program = info.program().unwrap();
    assert!(stages::set_gate(&mut program, "lift_mm", f64::NAN).is_err());
    let unknown = [GateRange::parse("lift=4..12").unwrap()];
    let said = sweep(&episodes, &unknown, &mut || true).unwrap_err().to_string();
    assert!(said.starts_with("no gate 'lift'; there are grasp_from,"), "{said}");
}
