//! Episodes around a small tube: the scripted baseline passes, resets and replays are exact, files
//! are checked.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

use std::path::Path;
use trocar_cell::{Action, CellEvent, Setpoint};
use trocar_scene::{Distribution, Factor, Scene, TaskName};
use trocar_specimen::Specimen;
use trocar_task::{
    Channels, Column, End, Episode, EpisodeFile, GateRange, Policy, Recording, STATE_SIZE, policy, read_channels, run,
    sweep,
};
use trocar_testing::tube::{ONE_END, resection, two_tubes};

fn specimen() -> Specimen {
    two_tubes(ONE_END, 3e-3)
}

fn record(scene: &Scene, specimen: &Specimen, name: &str, seed: u64, threads: usize) -> Recording {
    let mut episode = Episode::new(scene, specimen, threads).unwrap();
    let mut chosen = policy::named(name).unwrap();
    run(&mut episode, chosen.as_mut(), seed, &mut |_| true).unwrap()
}

#[test]
fn the_scripted_baseline_passes_and_its_files_tell_all_of_it() {
    let (scene, specimen) = (resection(), specimen());
    let recording = record(&scene, &specimen, "scripted", 3, 1);
    let s = &recording.summary;
    println!("{s:?}");
    assert!(s.passed && s.end == Some(End::Passed) && s.stage == 5, "{s:?}");
    assert!(s.held_to_end && !s.diverged && s.inverted_peak == 0 && s.rcm_within, "{s:?}");
    assert!((0.30..=0.70).contains(&s.grasp_at.unwrap()) && s.lift_mm.is_some_and(|mm| (8.0..13.0).contains(&mm)));
    assert!(s.passed_at("cut").unwrap() <= s.duration_s);
    assert!(recording.events.iter().any(|(_, e)| matches!(e, CellEvent::Cut { pieces: 1, .. })));

    let folder = tempfile::tempdir().unwrap();
    recording.write_into(folder.path()).unwrap();
    // Channels come back to the bit, and a sweep says at the scene's gates what the episode said.
    let path = folder.path().join("channels.parquet");
    let (info, rows) = read_channels(&path).unwrap();
    assert_eq!((&info, &rows), (&recording.info, &recording.channels));
    let swept = sweep(&[(info, rows)], &[GateRange::parse("lift_mm=8,30").unwrap()], &mut || true).unwrap();
    assert_eq!((swept.rows[0].stages[0], swept.rows[1].stages[0]), (5, 1));
    // A damaged file is an error that names it.
    let good = std::fs::read(&path).unwrap();
    for at in (0..good.len()).step_by(good.len() / 60) {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        std::fs::write(&path, &bad).unwrap();
        if let Err(e) = read_channels(&path) {
            assert!(e.to_string().contains("channels.parquet"), "{e}");
        }
        std::fs::write(&path, &good[..at]).unwrap();
        assert!(read_channels(&path).is_err(), "cut at {at}");
    }

    // What is kept beside the channels has a number a row and a name of its own.
    let mut more = recording.clone();
    let column = |name: &str, count: usize| Column { name: name.to_owned(), values: vec![1.0; count] };
    more.beside = vec![column("left_actor", recording.channels.len())];
    more.write_into(folder.path()).unwrap();
    assert_eq!(read_channels(&path).unwrap().1, recording.channels);
    for wrong in [column("time_s", recording.channels.len()), column("left_actor", 1)] {
        more.beside = vec![wrong];
        assert!(more.write_into(folder.path()).is_err());
    }

    // Replay: the same bits, on two threads.
    let path = folder.path().join("episode.trocar");
    let file = EpisodeFile::read(&path).unwrap();
    assert_eq!(file, recording.file);
    let verdict = file.verify(&scene, &specimen, 2, &mut || true).unwrap();
    assert!(verdict.same, "{verdict:?}");
    // Another action at step 50 is found there.
    let mut tampered = file.clone();
    tampered.steps[49].0.numbers[4] -= 0.25;
    let verdict = tampered.verify(&scene, &specimen, 1, &mut || true).unwrap();
    assert_eq!((verdict.same, verdict.first_difference), (false, Some(50)), "{verdict:?}");
    assert!(file.verify(&scene, &specimen, 1, &mut || false).is_err(), "stopped, which is no verdict");
    // Another draw at the start, another specimen before that.
    let mut other = file.clone();
    other.header.drawn = scene.draw(4).to_toml().unwrap();
    assert_eq!(other.verify(&scene, &specimen, 1, &mut || true).unwrap().first_difference, Some(0));
    let mut soft = specimen.clone();
    soft.organs[0].material.young_modulus_pa *= 1.001;
    assert!(file.verify(&scene, &soft, 1, &mut || true).unwrap().said.contains("specimen"));
    let mut stricter = scene;
    stricter.task.gates.lift_mm = 9.0;
    assert!(file.verify(&stricter, &specimen, 1, &mut || true).unwrap().said.contains("scene"));
    damaged(&path);
}

/// No damage to an episode file goes unnoticed.
fn damaged(path: &Path) {
    let good = std::fs::read(path).unwrap();
    let said = |bytes: &[u8]| EpisodeFile::parse(bytes).err();
    assert_eq!(said(&good), None);
    for at in (0..good.len()).step_by(good.len() / 200) {
        let mut bad = good.clone();
        bad[at] ^= 0x01;
        assert!(said(&bad).is_some(), "bit {at}");
        assert!(said(&good[..at]).is_some(), "cut at {at}");
    }
    assert!(said(b"").unwrap().contains("no episode file"));
    assert!(said(b"{}\n").unwrap().contains("no episode file"));
    assert!(said(b"\x00\xff\xff\n123").is_some());
    assert!(EpisodeFile::read(&path.with_file_name("none")).unwrap_err().to_string().contains("none"));
}

#[test]
fn the_scripted_baseline_passes_on_soft_and_on_stiff_tissue() {
    // The edges of the set `standard`, and softer than any of it.
    for young_modulus_pa in [2e3, 3e3, 48e3] {
        let mut scene = resection();
        scene.organs.entry("tube".to_owned()).or_default().material.young_modulus_pa = Some(young_modulus_pa);
        let s = record(&scene, &two_tubes(ONE_END, 2.2e-3), "scripted", 3, 0).summary;
        println!("{young_modulus_pa} Pa: {s:?}");
        assert!(s.passed && s.inverted_peak == 0 && s.warnings.is_empty(), "{young_modulus_pa} Pa: {s:?}");
        let [jaw_n, all] = [s.arms[0].peak_jaw_n, 0.5];
        assert!(young_modulus_pa > 8e3 || jaw_n < 0.5 * all, "soft tissue is held gently: {jaw_n} N");
    }
}

#[test]
fn a_reset_gives_the_same_bits_whatever_was_before() {
    let specimen = specimen();
    let scene = resection();
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    let mut scripted = policy::named("noise").unwrap();
    let mut go = |episode: &mut Episode, seed: u64, steps: usize| -> Vec<u64> {
        let seen = episode.reset(seed).unwrap();
        assert_eq!(seen.to_vec().len(), STATE_SIZE);
        scripted.begin(episode, seed).unwrap();
        let mut hashes = vec![episode.state_hash()];
        while hashes.len() < steps {
            for action in scripted.act(episode).unwrap() {
                episode.step(&action).unwrap();
                hashes.push(episode.state_hash());
            }
        }
        hashes
    };
    let first = go(&mut episode, 5, 110);
    let second = go(&mut episode, 6, 40);
    assert_ne!(first[0], second[0], "another seed is another start");
    assert_eq!(go(&mut episode, 5, 110), first);
    let mut new = Episode::new(&scene, &specimen, 2).unwrap();
    assert_eq!(go(&mut new, 5, 110), first, "a new episode on two threads");
    // A saved state goes on to the bit, in another episode too.
    let saved = new.save();
    let stay = |e: &Episode| {
        let at: Vec<Setpoint> = e.cell().observe().iter().map(|a| a.commanded).collect();
        Action::targets(&at)
    };
    let after = |e: &mut Episode| {
        for _ in 0..5 {
            let action = stay(e);
            e.step(&action).unwrap();
        }
        (e.state_hash(), e.rows().len(), e.observe())
    };
    let one = after(&mut new);
    episode.reset(1).unwrap();
    episode.restore(&saved).unwrap();
    assert_eq!(after(&mut episode), one);
    // An episode of another task is not continued.
    let mut other = scene.clone();
    other.task.name = TaskName::GraspLift;
    let mut other = Episode::new(&other, &specimen, 1).unwrap();
    let hash = other.state_hash();
    let said = other.restore(&saved).unwrap_err().to_string();
    assert!(said.contains("of the task appendix-resection"), "{said}");
    assert_eq!(other.state_hash(), hash);
    // Nor one of another scene; how long it may be does not matter.
    let mut near = scene;
    near.task.episode_s += 1.0;
    Episode::new(&near, &specimen, 1).unwrap().restore(&saved).unwrap();
    near.task.gates.lift_mm += 1.0;
    let said = Episode::new(&near, &specimen, 1).unwrap().restore(&saved).unwrap_err().to_string();
    assert!(said.contains("another scene or specimen"), "{said}");
}

#[test]
fn specimens_are_shifted_and_turned_by_the_seed() {
    let specimen = two_tubes(ONE_END, 4e-3);
    let mut scene = resection();
    scene.variation.factors.insert(Factor::SpecimenShift, Distribution::Within(4.0));
    scene.variation.factors.insert(Factor::SpecimenTurn, Distribution::Within(20.0));
    let middle = |e: &Episode| e.cell().world().axes[0].point_at(0.5);
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    episode.reset(1).unwrap();
    let (a, hash) = (middle(&episode), episode.state_hash());
    episode.reset(2).unwrap();
    assert!(middle(&episode).distance(a) > 1e-4);
    episode.reset(1).unwrap();
    assert_eq!((middle(&episode), episode.state_hash()), (a, hash));
}

#[test]
fn every_controller_and_task_runs_and_ends_are_told() {
    let specimen = two_tubes(ONE_END, 4e-3);
    let mut scene = resection();
    scene.task.episode_s = 2.0;
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    for name in policy::POLICIES {
        let mut chosen = policy::named(name).unwrap();
        let made = run(&mut episode, chosen.as_mut(), 1, &mut |_| true).unwrap();
        assert_eq!(chosen.name(), name);
        assert!(matches!(made.summary.end, Some(End::TimeOut)), "{name}: {:?}", made.summary.end);
        assert_eq!(made.channels.len(), 60, "{name}");
    }
    let refused = episode.step(&Action { space: trocar_cell::ActionSpace::Pivots, numbers: vec![0.0; 10] });
    assert!(refused.unwrap_err().to_string().contains("the time was up"));
    assert!(policy::named("best").err().unwrap().to_string().contains("scripted"));
    // A policy that gives nonsense ends the episode.
    struct Nonsense;
    impl Policy for Nonsense {
        fn name(&self) -> &str {
            "nonsense"
        }
        fn begin(&mut self, _: &Episode, _: u64) -> trocar_task::Result<()> {
            Ok(())
        }
        fn act(&mut self, _: &Episode) -> trocar_task::Result<Vec<Action>> {
            Ok(vec![Action { space: trocar_cell::ActionSpace::Pivots, numbers: vec![f64::NAN; 10] }])
        }
    }
    let made = run(&mut episode, &mut Nonsense, 1, &mut |_| true).unwrap();
    assert!(matches!(&made.summary.end, Some(End::PolicyError { why }) if why.contains("finite")));
    // The other two tasks pass.
    for task in [TaskName::PortReach, TaskName::GraspLift] {
        let mut scene = resection();
        scene.task.name = task;
        let made = record(&scene, &specimen, "scripted", 2, 1);
        assert!(made.summary.passed, "{task:?}: {:?}", made.summary);
    }
    let mut wrong = resection();
    wrong.task.organ = "liver".to_owned();
    assert!(Episode::new(&wrong, &specimen, 1).err().unwrap().to_string().contains("tube"));
}

#[test]
fn a_strong_cutter_closes_through_tissue_and_harms_nothing_else() {
    let specimen = two_tubes(ONE_END, 2.2e-3);
    for sever in [false, true] {
        let mut scene = resection();
        scene.task.sever = sever;
        let recording = record(&scene, &specimen, "scripted", 1, 1);
        let worst = |f: fn(&Channels) -> f64| recording.channels.iter().map(f).fold(0.0, f64::max);
        let s = &recording.summary;
        println!("sever {sever}: {} N at the blades, {s:?}", worst(|c| c.right.jaw_force_n));
        assert!(s.passed && !s.diverged && s.inverted_peak == 0, "{s:?}");
        // Blades that close through tissue shear it: from one period after they begin to, what the
        // jaws feel is the cut, which takes 19 mJ here.
        let open = recording.channels.iter().position(|c| c.task.cut_jaw > 0.99).unwrap();
        let closing = recording.channels[open..].iter().filter(|c| c.task.cut_jaw < 0.8);
        let pressing: Vec<f64> = closing.map(|c| c.right.jaw_force_n).collect();
        assert!(pressing.iter().any(|f| *f > 1.0) && pressing.iter().all(|f| *f < 20.0), "{pressing:?}");
        assert!(worst(|c| c.right.pierces) == 0.0 && s.warnings.is_empty());
    }
}

#[test]
fn an_offset_is_the_same_in_every_phase() {
    // The other arm stays where it is while the first approaches, enters and closes: what is told
    // to it must not wander off by the offset again with each of these phases.
    let mut episode = Episode::new(&resection(), &specimen(), 1).unwrap();
    episode.reset(5).unwrap();
    let start = episode.cell().observe()[1].commanded;
    let mut offset = policy::named("offset").unwrap();
    offset.begin(&episode, 5).unwrap();
    let mut told: Vec<Vec<f64>> = Vec::new();
    while told.len() < 100 {
        for action in offset.act(&episode).unwrap() {
            episode.step(&action).unwrap();
            told.push(action.numbers[5..10].to_vec());
        }
    }
    assert!(told.iter().all(|numbers| *numbers == told[0]), "{:?} {:?}", told[0], told[99]);
    let [a, b, deeper] = [told[0][0] - start.0[0], told[0][1] - start.0[1], told[0][2] - start.0[2]];
    let way = (0.12 * a).hypot(0.12 * b).hypot(deeper);
    assert!((way - 1e-3 * policy::OFFSET_MM).abs() < 1e-4, "{way} m");
}
