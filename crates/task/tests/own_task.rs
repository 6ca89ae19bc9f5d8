//! A task of one's own, from its file to its figures: the scripted steps pass it, its measures are
//! stored and swept, an abort ends it, and a replay needs nothing but the episode file.
#![allow(clippy::unwrap_used, reason = "tests")]

use trocar_cell::Action;
use trocar_scene::{Abort, Scene, ScriptStep, Side, Stage, StageOrder, TaskName, View};
use trocar_task::{End, Episode, EpisodeFile, GateRange, Policy, Recording, policy, prompt, read_channels, run, sweep};
use trocar_testing::tube::{ONE_END, resection, two_tubes};

fn stage(name: &str, when: &str) -> Stage {
    Stage { name: name.to_owned(), when: when.to_owned(), share: 1.0, ..Stage::default() }
}

fn step(grasp: Option<&str>, move_mm: Option<[f64; 3]>) -> ScriptStep {
    ScriptStep { arm: Side::Left, grasp: grasp.map(str::to_owned), move_mm, release: false, time_s: None, until: None }
}

fn pull_aside() -> Scene {
    let mut scene = resection();
    let task = &mut scene.task;
    (task.name, task.prompt) =
        (TaskName::new("pull-aside").unwrap(), Some("pull the {organ} with {grasper}".to_owned()));
    task.constants.insert("aside_mm".to_owned(), 3.0);
    let aside = "attached(left) in organ[0.2, 0.8] and aside(organ[0.4, 0.6]) >= constants.aside_mm";
    task.stages = vec![
        stage("grasp", "attached(left) in organ[0.2, 0.8]"),
        Stage {
            progress: Some("clamp(aside(organ[0.4, 0.6]) / constants.aside_mm, 0, 1)".to_owned()),
            ..stage("aside", aside)
        },
        Stage { share: 2.0, ..stage("hold", &format!("{aside} for 0.5 s")) },
    ];
    let by = ScriptStep {
        until: Some("aside(organ[0.4, 0.6]) > constants.aside_mm + 1 mm".to_owned()),
        ..step(None, Some([-10.0, 0.0, 0.0]))
    };
    task.script = vec![step(Some("organ[0.4, 0.6]"), None), step(None, Some([0.0, 0.0, 5.0])), by];
    scene.program().unwrap();
    scene
}

fn record(scene: &Scene, seed: u64) -> Recording {
    let mut episode = Episode::new(scene, &two_tubes(ONE_END, 3e-3), 1).unwrap();
    let mut scripted = policy::named("scripted").unwrap();
    run(&mut episode, scripted.as_mut(), seed, &mut |_| true).unwrap()
}

#[test]
fn it_is_passed_stored_swept_and_replayed() {
    let scene = pull_aside();
    assert!(prompt(&scene).starts_with("pull the tube with the left instrument"), "{}", prompt(&scene));
    let recording = record(&scene, 1);
    let s = &recording.summary;
    assert!(s.passed && s.score == 1.0 && s.end == Some(End::Passed), "{s:?}");
    let aside = |c: &trocar_task::Channels| c.measures[1];
    let held_s = |c: &trocar_task::Channels| c.measures[0];
    assert!(held_s(&recording.channels[0]) == -1.0 && aside(&recording.channels[0]) < 0.1);
    let last = recording.channels.last().unwrap();
    assert!((0.2..=0.8).contains(&held_s(last)) && (3.0..8.0).contains(&aside(last)), "{:?}", last.measures);

    let folder = tempfile::tempdir().unwrap();
    recording.write_into(folder.path()).unwrap();
    let (info, rows) = read_channels(&folder.path().join("channels.parquet")).unwrap();
    assert_eq!((&info, &rows), (&recording.info, &recording.channels));
    let range = GateRange::parse("aside_mm=1,3,50").unwrap();
    let swept = sweep(&[(info, rows)], &[range], &mut || true).unwrap();
    assert_eq!(swept.stages, ["grasp", "aside", "hold"]);
    assert_eq!(swept.rows.iter().map(|r| r.stages[0]).collect::<Vec<_>>(), [3, 3, 1]);

    // What the file says is enough: stages and all.
    let file = EpisodeFile::read(&folder.path().join("episode.trocar")).unwrap();
    assert!(scene.task.stages.iter().all(|stage| file.header.scene.contains(&stage.when)), "{}", file.header.scene);
    let verdict = file.verify(&scene, &two_tubes(ONE_END, 3e-3), 1, &mut || true).unwrap();
    assert!(verdict.same, "{verdict:?}");
    let mut other = scene;
    other.task.stages[2].when = other.task.stages[2].when.replace("0.5 s", "0.6 s");
    let verdict = file.verify(&other, &two_tubes(ONE_END, 3e-3), 1, &mut || true).unwrap();
    assert!(!verdict.same && verdict.said.contains("scene"), "{verdict:?}");
}

#[test]
fn an_abort_ends_it_and_any_order_is_any() {
    let mut scene = pull_aside();
    scene.task.aborts = vec![Abort { name: "too-far".to_owned(), when: "moved(organ[0.4, 0.6]) > 2 mm".to_owned() }];
    let recording = record(&scene, 1);
    assert_eq!(recording.summary.end, Some(End::Aborted { name: "too-far".to_owned() }));
    assert!(!recording.summary.passed && recording.summary.stage >= 1, "{:?}", recording.summary.progress);
    assert_eq!(recording.summary.why.as_deref(), Some("aborted by the task: too-far"));
    // The last stage first: what a listed order waits for passes as it happens.
    scene.task.aborts.clear();
    scene.task.stages.rotate_right(1);
    scene.task.episode_s = 8.0;
    scene.task.order = StageOrder::Any;
    let recording = record(&scene, 1);
    let times: Vec<f64> = recording.summary.progress.stages.iter().map(|s| s.time_s.unwrap()).collect();
    assert!(recording.summary.passed && times[0] > times[1] && times[0] > times[2], "{times:?}");
}

/// A scene whose script grasps and waits, for at most `seconds`.
fn waiting(when: &str, seconds: f64) -> Scene {
    let mut scene = pull_aside();
    scene.task.stages = vec![stage("it", when)];
    scene.task.script = vec![step(None, None)];
    scene.task.episode_s = seconds;
    scene
}

#[test]
fn a_camera_sees_what_nothing_hides() {
    let mut scene =
        waiting("visible(behind, organ) > 2 and visible(before, organ) > 2 and visible(aside, organ) > 2", 1.0);
    // The second tube is 25 mm nearer to the arms and 12 mm lower.
    let camera = |name: &str, eye_m: [f64; 3], target_m: [f64; 3]| {
        let mut camera = scene.cameras[0].clone();
        (camera.name, camera.view) = (name.to_owned(), View::LookAt { eye_m, target_m, up: [0.0, 0.0, 1.0] });
        camera
    };
    let middle = [0.0, 0.46, 0.045];
    scene.cameras = vec![
        camera("behind", [0.0, 0.53, 0.05], middle),
        camera("before", [0.0, 0.40, 0.0162], middle),
        camera("aside", [0.0, 0.40, 0.0162], [0.0, 0.34, 0.0]),
    ];
    let recording = record(&scene, 1);
    for row in &recording.channels {
        let [behind, before, aside, ..] = row.measures;
        assert!(behind > 0.95 && before < 0.1 && aside == 0.0, "{:?}", &row.measures[..3]);
    }
}

#[test]
fn soft_tissue_is_not_crushed() {
    let mut scene = pull_aside();
    scene.organs.entry("tube".to_owned()).or_default().material.young_modulus_pa = Some(4000.0);
    let recording = record(&scene, 1);
    assert!(recording.summary.passed, "{:?}", recording.summary.why);
}

#[test]
fn wide_organs_are_pinched() {
    let mut specimen = two_tubes(ONE_END, 2e-3);
    let wide = &mut specimen.organs[0];
    for p in wide.body.vertices.iter_mut().chain(&mut wide.surface.vertices) {
        (p.y, p.z) = (1.7 * p.y, 1.7 * p.z);
    }
    // The second one lies close beside it, so that there is no room for blades.
    let beside = &mut specimen.organs[1];
    for p in beside.body.vertices.iter_mut().chain(&mut beside.surface.vertices) {
        (p.y, p.z) = (p.y - 0.0124, p.z - 0.012);
    }
    let mut scene = waiting("attached(left) in organ[0.3, 0.7]", 8.0);
    scene.task.script = vec![step(Some("organ[0.4, 0.6]"), None)];
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    let mut scripted = policy::named("scripted").unwrap();
    let recording = run(&mut episode, scripted.as_mut(), 1, &mut |_| true).unwrap();
    assert!(recording.summary.passed, "{:?}", recording.summary.why);
    assert!(recording.channels.iter().all(|row| row.task.pierced == 0.0));
}

/// Holds the arms where they are for some periods; then it has nothing left to do.
struct Brief(u32);

impl Policy for Brief {
    fn name(&self) -> &'static str {
        "brief"
    }

    fn begin(&mut self, _: &Episode, _: u64) -> trocar_task::Result<()> {
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> trocar_task::Result<Vec<Action>> {
        let still = Action::targets(&episode.cell().observe().iter().map(|arm| arm.commanded).collect::<Vec<_>>());
        let left = self.0;
        self.0 = left.saturating_sub(1);
        Ok(if left > 0 { vec![still] } else { Vec::new() })
    }

    fn finished(&self) -> bool {
        self.0 == 0
    }
}

#[test]
fn an_end_that_the_policy_chose_is_replayed_too() {
    let mut scene = pull_aside();
    (scene.task.stages, scene.task.stop_when_passed) = (vec![stage("begin", "lift_mm < 100")], false);
    (scene.task.constants, scene.task.script) = Default::default();
    let mut episode = Episode::new(&scene, &two_tubes(ONE_END, 3e-3), 1).unwrap();
    let recording = run(&mut episode, &mut Brief(5), 1, &mut |_| true).unwrap();
    assert_eq!((recording.file.steps.len(), &recording.file.header.end), (5, &Some(End::Passed)));
    let verify = |file: &EpisodeFile| file.verify(&scene, &two_tubes(ONE_END, 3e-3), 1, &mut || true).unwrap();
    let verdict = verify(&recording.file);
    assert!(verdict.same, "{verdict:?}");
    // Another end is found.
    let mut other = recording.file;
    other.header.end = Some(End::Finished);
    assert_eq!(verify(&other).said, "it ends with passed, not finished");
}
