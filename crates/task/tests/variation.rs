//! Episodes that differ by their seed: the same bits whatever was before, and replays that draw
//! nothing.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::sync::Arc;
use trocar_cell::{Action, ActionSpace, CellEvent, Setpoint};
use trocar_scene::{BackendName, Distribution, Factor, Scene, SpecimenSource, TissueSource, VariationSet};
use trocar_specimen::{Parameter, Posterior, Prior, Specimen, Threads};
use trocar_task::{Episode, EpisodeFile, Result, SpecimenSupply, Step, policy, run};
use trocar_testing::tube::{ONE_END, resection, two_tubes};

/// Another tube for each seed of an anatomy.
struct Tubes;

impl SpecimenSupply for Tubes {
    fn get(&mut self, source: &SpecimenSource) -> Result<Arc<Specimen>> {
        let mut specimen = two_tubes(ONE_END, 4e-3);
        let by = 1e-3 * f64::from(source.seed);
        for organ in &mut specimen.organs {
            organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices).for_each(|p| p.x += by);
            organ.base.x += by;
        }
        Ok(Arc::new(specimen))
    }
}

fn scene(set: VariationSet) -> Scene {
    let mut scene = resection();
    scene.task.episode_s = 0.5;
    scene.variation.set = set;
    scene
}

fn steps(episode: &mut Episode, seed: u64) -> Vec<u64> {
    episode.reset(seed).unwrap();
    let mut hashes = vec![episode.state_hash()];
    for _ in 0..3 {
        let at: Vec<Setpoint> = episode.cell().observe().iter().map(|a| a.commanded).collect();
        episode.step(&Action::targets(&at)).unwrap();
        hashes.push(episode.state_hash());
    }
    hashes
}

#[test]
fn a_clone_goes_on_with_the_same_bits_and_alone() {
    for backend in [BackendName::Tetrahedra, BackendName::Lattice] {
        let mut scene = scene(VariationSet::Standard);
        scene.tissue.backend = backend;
        scene.rates.control_delay_ms = 50.0;
        scene.task.episode_s = 6.0;
        let mut episode = Episode::with_specimens(&scene, Box::new(Tubes), 1).unwrap();
        // Up to when the jaws hold the tube.
        let mut held = false;
        let mut until_held = |step: &Step| {
            held |= step.events.iter().any(|event| matches!(event, CellEvent::Attached { .. }));
            !held
        };
        let mut scripted = policy::named("scripted").unwrap();
        run(&mut episode, scripted.as_mut(), 1, &mut until_held).unwrap_err();
        assert!(held, "the script grasps the tube");
        let mut clone = episode.try_clone(Box::new(Tubes)).unwrap();
        assert_eq!((clone.state_hash(), clone.rows()), (episode.state_hash(), episode.rows()));
        let on = |episode: &mut Episode, rise: f64| {
            let mut numbers = vec![0.0; 10];
            numbers[2] = rise;
            episode.step(&Action { space: ActionSpace::Tip, numbers }).unwrap();
            episode.state_hash()
        };
        let before = episode.state_hash();
        let next: Vec<u64> = (0..4).map(|_| on(&mut clone, 1e-3)).collect();
        assert_eq!(episode.state_hash(), before, "a step of the clone does not move the first");
        assert_eq!((0..4).map(|_| on(&mut episode, 1e-3)).collect::<Vec<_>>(), next);
        assert_eq!(steps(&mut clone, 2), steps(&mut episode, 2), "another world than the one that was cloned");
    }
}

#[test]
fn a_seed_gives_the_same_bits_whatever_was_before() {
    for set in [VariationSet::Standard, VariationSet::Hard] {
        let scene = scene(set);
        let mut episode = Episode::with_specimens(&scene, Box::new(Tubes), 1).unwrap();
        let (one, first) = (steps(&mut episode, 1), episode.drawn().clone());
        let saved = episode.save();
        let two = steps(&mut episode, 2);
        assert_ne!(one[0], two[0]);
        assert_ne!(first, *episode.drawn());
        assert_eq!(steps(&mut episode, 1), one);
        let mut other = Episode::with_specimens(&scene, Box::new(Tubes), 2).unwrap();
        assert_eq!(steps(&mut other, 1), one);
        // A saved state goes on in an episode that has another cell now.
        steps(&mut other, 2);
        other.restore(&saved).unwrap();
        assert_eq!((other.state_hash(), other.drawn()), (one[3], &first));
        assert_eq!(other.summary().drawn.as_ref(), Some(&first));
    }
}

#[test]
fn starts_do_not_depend_on_what_else_is_drawn() {
    let plain = scene(VariationSet::None);
    let specimen = two_tubes(ONE_END, 4e-3);
    let mut episode = Episode::new(&plain, &specimen, 1).unwrap();
    episode.reset(5).unwrap();
    let start = episode.cell().observe()[0].commanded;
    let mut softer = plain;
    softer.variation.factors.insert(Factor::Modulus, Distribution::Uniform([6.0, 12.0]));
    softer.variation.factors.insert(Factor::CameraShift, Distribution::Within(5.0));
    let mut episode = Episode::new(&softer, &specimen, 1).unwrap();
    episode.reset(5).unwrap();
    assert_eq!(episode.cell().observe()[0].commanded, start);
    assert_ne!(episode.arranged_scene().cameras, softer.cameras);
    let modulus = episode.arranged_scene().organs["tube"].material.young_modulus_pa.unwrap();
    assert!((6e3..12e3).contains(&modulus) && episode.specimen().organs[0].material.young_modulus_pa != modulus);
}

#[test]
fn a_drawn_delay_is_in_the_cell_and_in_the_episode_file() {
    let mut scene = scene(VariationSet::None);
    scene.variation.factors.insert(Factor::ControlDelay, Distribution::Uniform([40.0, 120.0]));
    let specimen = two_tubes(ONE_END, 4e-3);
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    let mut run =
        |seed: u64| run(&mut episode, policy::named("random").unwrap().as_mut(), seed, &mut |_| true).unwrap();
    let (one, other) = (run(1), run(2));
    let delay = |drawn: &trocar_scene::Drawn| {
        drawn.values.iter().find(|v| v.factor == Factor::ControlDelay).map(|v| v.value).unwrap()
    };
    let [first, second] = [&one, &other].map(|r| delay(r.summary.drawn.as_ref().unwrap()));
    assert!(first != second && (40.0..=120.0).contains(&first), "{first} {second}");
    assert_eq!(run(1).file, one.file, "the same bits again");
    let written: Scene = trocar_specimen::parse_toml(&one.file.header.scene).unwrap();
    assert!(one.file.verify(&written, &specimen, 2, &mut || true).unwrap().same);
    // With another delay the same actions give another episode.
    let mut file = one.file;
    file.header.drawn = file.header.drawn.replace(&first.to_string(), &second.to_string());
    let verdict = file.verify(&written, &specimen, 1, &mut || true).unwrap();
    assert!(!verdict.same && verdict.first_difference.is_some_and(|k| k > 0), "{verdict:?}");
}

#[test]
fn a_replay_draws_nothing() {
    let scene = scene(VariationSet::Standard);
    let mut episode = Episode::with_specimens(&scene, Box::new(Tubes), 1).unwrap();
    let mut chosen = policy::named("random").unwrap();
    let recording = run(&mut episode, chosen.as_mut(), 3, &mut |_| true).unwrap();
    assert_eq!(recording.summary.drawn, Some(scene.draw(3)));
    let folder = tempfile::tempdir().unwrap();
    recording.write_into(folder.path()).unwrap();
    let path = folder.path().join("episode.trocar");
    let file = EpisodeFile::read(&path).unwrap();
    assert_eq!(file.drawn().unwrap(), scene.draw(3));
    let written: Scene = trocar_specimen::parse_toml(&file.header.scene).unwrap();
    assert_eq!((&written.specimen, written.variation.varies()), (&scene.draw(3).specimen, false));
    let specimen = Tubes.get(&written.specimen).unwrap();
    let verdict = file.verify(&written, &specimen, 2, &mut || true).unwrap();
    assert!(verdict.same, "{verdict:?}");
    // Whatever would be drawn from the scene.
    assert!(file.verify(&self::scene(VariationSet::Easy), &specimen, 1, &mut || true).unwrap().same);
    // One specimen is not enough for a scene that draws from several.
    let said = Episode::new(&scene, &specimen, 1).err().unwrap().to_string();
    assert!(said.contains("draw from 8 specimens"), "{said}");
    // Files of earlier versions are refused in a line.
    let bytes = std::fs::read(&path).unwrap();
    let end = bytes.iter().position(|b| *b == b'\n').unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap().replace("\"version\":8", "\"version\":7");
    let said = EpisodeFile::parse(&[header.as_bytes(), &bytes[end..]].concat()).unwrap_err();
    assert!(said.contains("version 7; trocar-episode version 8 is read"), "{said}");
}

/// The tube with what lifts tell about it.
fn identified() -> Specimen {
    let mut specimen = two_tubes(ONE_END, 4e-3);
    let prior = |name, range| Prior { name, range, interval: [0.0; 3], width: 0.0 };
    let mut posterior = Posterior {
        recording: "film".to_owned(),
        lifts: vec![0],
        landmark_rmse_mm: 1.0,
        mean: vec![0.0, 0.3, 0.0],
        covariance: vec![vec![0.04, 0.0, 0.0], vec![0.0, 0.2, 0.1], vec![0.0, 0.1, 0.3]],
        parameters: vec![
            prior(Parameter::BaseLength, [0.05, 0.3]),
            prior(Parameter::ThreadsStiffness, [5.0, 2e4]),
            prior(Parameter::YoungModulus, [3e3, 1e5]),
        ],
    };
    posterior.summarise();
    specimen.organs[0].threads = Some(Threads { from: 0.6, to: 1.0, slack_m: 2e-3, stiffness_n_m2: 100.0 });
    specimen.organs[0].posterior = Some(posterior);
    specimen
}

#[test]
fn support_and_tissue_are_drawn_from_a_posterior_and_replayed() {
    let mut scene = scene(VariationSet::None);
    scene.variation.tissue = TissueSource::Posterior;
    assert!(scene.variation.varies());
    let specimen = identified();
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    let mut run =
        |seed: u64| run(&mut episode, policy::named("random").unwrap().as_mut(), seed, &mut |_| true).unwrap();
    let (one, other) = (run(1), run(2));
    let value = |drawn: &trocar_scene::Drawn| drawn.tissue[&("tube".to_owned(), Parameter::YoungModulus)];
    let [first, second] = [&one, &other].map(|r| value(r.summary.drawn.as_ref().unwrap()));
    assert!(first != second && (3e3..1e5).contains(&first), "{first} {second}");
    assert_eq!(run(1).file, one.file, "the same bits again");
    // Its drawn values have their names, and give the scene its values.
    let written: Scene = trocar_specimen::parse_toml(&one.file.header.scene).unwrap();
    let arranged = written.with_drawn(&one.file.drawn().unwrap(), &specimen);
    let organ = &arranged.organs["tube"];
    assert_eq!(organ.material.young_modulus_pa, Some(first));
    let threads = organ.threads.unwrap();
    assert_eq!((threads.from, threads.slack_m), (0.6, 2e-3), "what is not drawn is the specimen's");
    assert!(one.file.header.drawn.contains("\"tube.young_modulus_pa\" = "), "{}", one.file.header.drawn);
    assert_eq!(one.file.drawn().unwrap(), one.summary.drawn.clone().unwrap());
    assert!(one.file.verify(&written, &specimen, 2, &mut || true).unwrap().same);
    // Without a posterior there is nothing to draw from.
    let said = Episode::new(&scene, &two_tubes(ONE_END, 4e-3), 1).err().unwrap().to_string();
    assert!(said.contains("has a posterior to draw from; make one with `trocar identify`"), "{said}");
}
