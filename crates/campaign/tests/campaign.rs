//! Campaigns on this machine: names with dots, damaged files, interruptions, wrong options, and the
//! contents of the table.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier, Mutex};
use tempfile::TempDir;
use trocar_campaign::{Campaign, EpisodeFiles, Job, Manifest, PolicySpec, Store, run_episode};
use trocar_core::{Silent, StopAfter};
use trocar_remote::{Array, Call, Dialect, Loopback, LoopbackOptions, Map, Value};
use trocar_scene::{BackendName, Distribution, Factor, Scene, Specimens, Split, TaskName, VariationSet};
use trocar_task::EpisodeFile;
use trocar_testing::tube;
use trocar_workflow::EpisodeRun;

fn scene(folder: &Path) -> PathBuf {
    tube::reach(folder, "reach.toml", 0.5, &["endoscope"])
}

fn campaign(folder: &Path, policies: &[&str], episodes: usize) -> Campaign {
    Campaign {
        scene: folder.join("reach.toml").display().to_string(),
        policies: policies.iter().map(|p| PolicySpec::parse(p).unwrap()).collect(),
        episodes,
        split: Split::Seen,
        seed: 0,
        tissue: None,
        variation: Some(VariationSet::None),
        backend: None,
        cell_mm: None,
        by: Vec::new(),
        jobs: 1,
        retry_failed: false,
        surfaces: false,
        phantoms: folder.join("phantoms"),
    }
}

#[test]
fn episodes_of_names_with_dots_are_done_again_side_by_side() {
    let dir = TempDir::new().unwrap();
    let scene = trocar_scene::Scene::read(&scene(dir.path()).display().to_string()).unwrap();
    let specimen = tube::two_tubes(tube::ONE_END, 4e-3);
    let policies = ["v1.0=random", "v1.1=random"].map(|p| PolicySpec::parse(p).unwrap());
    let manifest = Manifest::new(&scene, &specimen, &policies, 40, (Split::Seen, 0)).unwrap();
    let store = Store::open(&dir.path().join("campaign"), &manifest).unwrap();
    let jobs: Vec<Job> = manifest.jobs().collect();
    let next = AtomicUsize::new(0);
    let together = Barrier::new(4);
    // Twice: what is there goes aside the second time.
    let work = || -> trocar_campaign::Result<()> {
        together.wait();
        loop {
            let k = next.fetch_add(1, Ordering::SeqCst);
            let Some(job) = jobs.get(k % jobs.len()).filter(|_| k < 6 * jobs.len()) else { return Ok(()) };
            let text = format!("{k}").into_bytes();
            store.put(job, &EpisodeFiles(vec![("result.json".to_owned(), text)]))?;
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            worker.join().unwrap().unwrap();
        }
    });
    for job in &jobs {
        assert!(store.episode(&job.policy.name, job.index).join("result.json").exists());
    }
    assert_eq!(std::fs::read_dir(store.folder().join("under-way")).unwrap().count(), 0, "something was left aside");
}

#[test]
fn a_damaged_file_of_an_episode_is_named_with_the_remedy_and_nothing_is_half_new() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    let outputs = || ["table.csv", "report.html", "result.json"].map(|n| std::fs::read(folder.join(n)).unwrap());
    campaign(dir.path(), &["random"], 2).run(&folder, &Silent).unwrap();
    let films = || std::fs::read_dir(folder.join("pictures")).unwrap().count();
    assert_eq!(films(), 2, "both fail, and are filmed");
    for file in ["channels.parquet", "episode.trocar", "result.json"] {
        let before = outputs();
        let episode = folder.join("episodes/random/000001");
        let whole = std::fs::read(episode.join(file)).unwrap();
        for damage in [Some(whole[..whole.len() / 2].to_vec()), Some(vec![0xff; 40]), None] {
            match damage {
                Some(bytes) => std::fs::write(episode.join(file), bytes).unwrap(),
                // An episode without its result is none, and is run again.
                None if file == "result.json" => continue,
                None => std::fs::remove_file(episode.join(file)).unwrap(),
            }
            if file == "episode.trocar" {
                // It is read to be filmed.
                let _ = std::fs::remove_file(folder.join("pictures/random-000001.webp"));
            }
            // Another policy beside it would change the table.
            let why = campaign(dir.path(), &["random", "scripted"], 2).run(&folder, &Silent).unwrap_err().to_string();
            assert!(why.contains("000001 holds a damaged episode") && why.contains("remove it"), "{file}: {why}");
            assert_eq!(before, outputs(), "{file}: some outputs are of now, some of before");
        }
        std::fs::remove_dir_all(&episode).unwrap();
        campaign(dir.path(), &["random"], 2).run(&folder, &Silent).unwrap();
        assert_eq!(before, outputs(), "{file}: what was run again is the same");
    }
}

#[test]
fn an_interrupted_campaign_has_a_table_of_what_is_kept_and_says_how_to_go_on() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    let two = ["random", "scripted"];
    let table = || std::fs::read_to_string(folder.join("table.csv")).unwrap();
    for (most, kept) in [(0, 0), (1, 1), (2, 3)] {
        let why = campaign(dir.path(), &two, 3).run(&folder, &StopAfter::new(most as u64)).unwrap_err();
        let said = format!("{kept} of 6 episodes are finished");
        assert!(why.to_string().contains(&said) && why.to_string().contains("continues"), "{why}");
        assert_eq!(table().lines().count(), 1 + kept);
        let result: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("result.json")).unwrap()).unwrap();
        assert_eq!((&result["episodes"], &result["planned"]), (&kept.into(), &6.into()));
        assert!(std::fs::read_to_string(folder.join("report.html")).unwrap().contains("</html>"));
    }
    assert!(!folder.join("pictures").exists(), "films take long");
    let whole = campaign(dir.path(), &two, 3).run(&folder, &Silent).unwrap();
    assert_eq!((whole.episodes, table().lines().count()), (6, 7));
}

#[test]
fn an_episode_that_does_not_come_out_as_it_was_is_not_filmed() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    campaign(dir.path(), &["random"], 2).run(&folder, &Silent).unwrap();
    std::fs::remove_dir_all(folder.join("pictures")).unwrap();
    // As another machine might have had it: the third state is another one.
    let path = folder.join("episodes/random/000001/episode.trocar");
    let mut file = EpisodeFile::read(&path).unwrap();
    file.steps[2].1 ^= 1;
    file.write(&path).unwrap();
    campaign(dir.path(), &["random"], 2).run(&folder, &Silent).unwrap();
    assert!(folder.join("pictures/random-000000.webp").exists());
    assert!(!folder.join("pictures/random-000001.webp").exists());
}

#[test]
fn what_cannot_be_is_refused_before_a_specimen_is_made() {
    let dir = TempDir::new().unwrap();
    // Whatever gets as far as the specimen says that this is no folder for phantoms.
    std::fs::write(dir.path().join("phantoms"), "").unwrap();
    let folder = dir.path().join("campaign");
    let said = |change: &dyn Fn(&mut Campaign)| {
        let mut made = campaign(dir.path(), &["random"], 1);
        made.scene = "cell-a".to_owned();
        change(&mut made);
        made.run(&folder, &Silent).unwrap_err().to_string()
    };
    assert!(said(&|_| ()).contains("phantoms"));
    assert!(said(&|c| c.episodes = 0).starts_with("--episodes 0: "));
    assert!(said(&|c| c.jobs = 1_000_000).starts_with("--jobs 1000000: "));
    assert!(said(&|c| c.policies.clear()).contains("--policy"));
    assert!(said(&|c| c.policies = [&c.policies[..], &c.policies].concat()).contains("two policies"));
    assert!(said(&|c| (c.seed, c.episodes) = (u64::MAX, 2)).starts_with("--seed 18446744073709551615: "));
    assert!(!folder.exists(), "nothing was begun");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("thesis.txt"), "mine").unwrap();
    assert!(said(&|_| ()).contains("no campaign"));
    // What is there and cannot be read is not missing.
    std::fs::create_dir(folder.join("campaign.json")).unwrap();
    let why = said(&|_| ());
    assert!(why.contains("campaign.json") && !why.contains("missing") && !why.contains("new folder"), "{why}");
}

#[test]
fn the_table_says_why_when_and_how_far_off() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    let result = campaign(dir.path(), &["random", "scripted"], 1).run(&folder, &Silent).unwrap();
    let text = std::fs::read_to_string(folder.join("table.csv")).unwrap();
    let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let of = |line: &str, name: &str| {
        line.split(',').nth(head.iter().position(|h| *h == name).expect(name)).unwrap().to_owned()
    };
    let (random, scripted) = (text.lines().nth(1).unwrap(), text.lines().nth(2).unwrap());
    let why = of(random, "why");
    assert!(why.starts_with("out of reach: the first target stayed "), "{why}");
    assert!(of(scripted, "lag_ms").parse::<f64>().unwrap() > 1.0, "a tip is behind its command: {scripted}");
    for name in ["rcm_loaded_median_mm", "peak_jaw_n", "reach-1_time_s", "reach-2_time_s", "reach-3_time_s"] {
        let value = of(random, name);
        assert!(value.is_empty() || value.parse::<f64>().is_ok(), "{name}: {value}");
    }
    assert!(result.policies.iter().all(|p| p.lag_ms.is_some() && p.peak_jaw_n.is_some()));
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains("Tracking lag") && page.contains("Jaw force"));
}

#[test]
fn an_address_has_no_secret_in_any_file_and_a_failure_is_told() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    let server = Loopback::start(&LoopbackOptions::default(), |_| Err("out of memory".to_owned())).unwrap();
    let address = format!("{}/policy?token=secret", server.url());
    let result = campaign(dir.path(), &[&address], 1).run(&folder, &Silent).unwrap();
    let name = server.url().replace("://", "-").replace(':', "-");
    assert_eq!(result.policies[0].policy, name);
    assert!(result.policies[0].policy_error.as_ref().unwrap().contains("out of memory"), "{result:?}");
    let mut open = vec![folder.clone()];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()));
        } else {
            let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
            assert!(!text.contains("secret") && !path.display().to_string().contains("secret"), "{}", path.display());
        }
    }
    assert!(std::fs::read_to_string(folder.join("report.html")).unwrap().contains("--retry-failed"));
    // The same address goes on; one with another query is another policy.
    campaign(dir.path(), &[&address], 1).run(&folder, &Silent).unwrap();
    let other = format!("{}/policy?token=other", server.url());
    let other = campaign(dir.path(), &[&other], 1).run(&folder, &Silent);
    assert!(other.unwrap_err().to_string().contains("another policy"));
}

/// A server whose arms stand still.
fn still() -> Loopback {
    Loopback::start(&LoopbackOptions::default(), |_| {
        let array = Array::from_f64(&[8, 10], &[0.1; 80]).map_err(|e| e.to_string())?;
        Ok(Map::from([("actions".to_owned(), Value::from(array))]))
    })
    .unwrap()
}

#[test]
fn one_episode_of_a_server_has_the_same_files_as_any_other_and_a_page() {
    let dir = TempDir::new().unwrap();
    let server = still();
    let run = EpisodeRun {
        scene: scene(dir.path()).display().to_string(),
        policy: format!("mine={}", server.url()),
        seed: 3,
        variation: None,
        surfaces: false,
        threads: 1,
        phantoms: dir.path().join("phantoms"),
    };
    let output = dir.path().join("episode");
    let made = run_episode(&run, &output, &Silent).unwrap();
    assert_eq!((made.result.policy.as_str(), made.result.seed), ("mine", 3));
    assert!((made.result.summary.duration_s - 0.5).abs() < 1e-9);
    for name in ["episode.trocar", "channels.parquet", "result.json"] {
        assert!(output.join(name).is_file(), "{name}");
    }
    let page = std::fs::read_to_string(&made.report).unwrap();
    for text in
        ["Episode of the policy mine, seed 3", "the time was up", "reach-1", "Distance to the targets", "At the end"]
    {
        assert!(page.contains(text), "{text}");
    }
    // The same server in a campaign gives the same episode.
    let policy = format!("mine={}", server.url());
    let mut same = campaign(dir.path(), &[&policy], 1);
    same.seed = 3;
    same.run(&dir.path().join("campaign"), &Silent).unwrap();
    let kept = std::fs::read(dir.path().join("campaign/episodes/mine/000000/episode.trocar")).unwrap();
    assert_eq!(kept, std::fs::read(output.join("episode.trocar")).unwrap());
}

#[test]
fn an_episode_without_its_policy_leaves_nothing() {
    let dir = TempDir::new().unwrap();
    let scene = scene(dir.path()).display().to_string();
    let run = |policy: &str, progress: &dyn trocar_core::Progress| {
        let run = EpisodeRun {
            scene: scene.clone(),
            policy: policy.to_owned(),
            seed: 0,
            variation: None,
            surfaces: false,
            threads: 1,
            phantoms: dir.path().into(),
        };
        let said = run_episode(&run, &dir.path().join("out"), progress).unwrap_err().to_string();
        assert!(!dir.path().join("out").exists(), "{said}");
        said
    };
    assert!(run("genius", &Silent).contains("--policy genius"));
    assert!(run("python:nothing", &Silent).contains("python:FILE.py:NAME"));
    let server = still();
    assert!(run(server.url().as_str(), &StopAfter::new(2)).contains("interrupted"));
}

#[test]
fn successes_are_filmed_too() {
    let dir = TempDir::new().unwrap();
    let text = std::fs::read_to_string(scene(dir.path())).unwrap().replace("episode_s = 0.5", "episode_s = 20.0");
    std::fs::write(dir.path().join("reach.toml"), text).unwrap();
    let folder = dir.path().join("campaign");
    let result = campaign(dir.path(), &["scripted"], 1).run(&folder, &Silent).unwrap();
    assert_eq!((result.passed, result.policies[0].ends.passed), (1, 1), "{result:?}");
    assert!(folder.join("pictures/scripted-000000.webp").is_file());
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains("Campaign of 1 episode,") && page.contains("There were none."));
    assert!(page.contains("Successes") && page.contains("image/webp"));
}

/// What a server was asked: for a reset or not, with which step and which session.
type Asked = Arc<Mutex<Vec<(bool, i64, String)>>>;

#[test]
fn a_roboarena_server_is_told_of_every_episode_by_its_name() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let mut metadata = Map::from([("image_resolution".to_owned(), Value::Nil)]);
    metadata.extend(["needs_wrist_camera", "needs_session_id"].map(|k| (k.to_owned(), Value::Bool(true))));
    metadata.insert("n_external_cameras".to_owned(), Value::Int(0));
    let options = LoopbackOptions { metadata, dialect: Dialect::RoboArena, ..LoopbackOptions::default() };
    let asked = Asked::default();
    let told = Arc::clone(&asked);
    let server = Loopback::start(&options, move |call| {
        let (reset, map) = match call {
            Call::Reset(map) => (true, map),
            Call::Infer(map) => (false, map),
        };
        let number = |name: &str| match map.get(name) {
            Some(Value::Int(n)) => *n,
            _ => -1,
        };
        let session = match map.get("session_id") {
            Some(Value::Text(name)) => name.clone(),
            _ => String::new(),
        };
        told.lock().unwrap().push((reset, number("episode/step"), session));
        // Which ends the connection.
        if number("episode/seed") == 1 && number("episode/step") > 0 {
            return Err("out of memory".to_owned());
        }
        let array = Array::from_f64(&[8, 10], &[0.1; 80]).map_err(|e| e.to_string())?;
        Ok(Map::from([("actions".to_owned(), Value::from(array))]))
    })
    .unwrap();
    let policy = format!("mine={}", server.url());
    campaign(dir.path(), &[&policy], 4).run(&dir.path().join("campaign"), &Silent).unwrap();
    let asked = asked.lock().unwrap();
    let shown: Vec<(bool, i64)> = asked.iter().map(|(reset, step, _)| (*reset, *step)).collect();
    // Half a second is 15 periods: two chunks. The second episode ends at its second.
    let episode = [(true, -1), (false, 0), (false, 8)];
    assert_eq!(shown, [episode; 4].concat());
    let mut sessions: Vec<&str> = asked.iter().map(|(.., session)| session.as_str()).collect();
    sessions.dedup();
    assert_eq!(sessions.len(), 4, "one an episode, in all its messages: {asked:?}");
    sessions.sort_unstable();
    sessions.dedup();
    assert!(sessions.len() == 4 && !sessions.contains(&""), "{asked:?}");
}

#[test]
fn episodes_have_the_specimens_that_are_drawn_for_them() {
    let dir = TempDir::new().unwrap();
    let file = scene(dir.path());
    tube::two_tubes(tube::ONE_END, 3.4e-3).write(&dir.path().join("other")).unwrap();
    let mut varied = Scene::read(&file.display().to_string()).unwrap();
    let paths = vec!["tube".to_owned(), "other".to_owned()];
    varied.variation.specimens = Some(Specimens { paths, phantoms: Vec::new(), seeds: [1, 1] });
    varied.variation.factors.insert(Factor::Modulus, Distribution::LogUniform([6.0, 24.0]));
    std::fs::write(&file, varied.to_toml().unwrap()).unwrap();
    let run = |name: &str, jobs: usize| {
        let campaign = Campaign { jobs, split: Split::Both, ..campaign(dir.path(), &["random"], 6) };
        campaign.run(&dir.path().join(name), &Silent).unwrap().hash
    };
    assert_eq!(run("one", 1), run("two", 2));
    let text = std::fs::read_to_string(dir.path().join("two/table.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let at = |name: &str| head.iter().position(|h| h == name).unwrap();
    let (specimen, modulus, tilt) = (at("drawn.specimen"), at("drawn.modulus_kpa"), at("drawn.left.tilt_deg"));
    for (index, row) in lines.enumerate() {
        let drawn = varied.draw(Split::Both.seed(index as u64));
        assert_eq!(row[specimen], drawn.specimen.label());
        for (column, name) in [(modulus, "modulus_kpa"), (tilt, "left.tilt_deg")] {
            let value = drawn.values.iter().find(|v| v.name() == name).unwrap().value;
            assert_eq!(row[column].parse::<f64>().unwrap(), value);
        }
    }
    let seen: std::collections::BTreeSet<String> =
        (0..6).map(|k| varied.draw(Split::Both.seed(k)).specimen.label()).collect();
    assert_eq!(seen.len(), 2, "the seen specimen and the unseen one");
    // Videos are replays: each has its own specimen.
    assert!(std::fs::read_dir(dir.path().join("two/pictures")).unwrap().count() > 2);
}

#[test]
fn organs_of_other_specimens_are_in_tables_and_in_replays() {
    let dir = TempDir::new().unwrap();
    let file = scene(dir.path());
    for (name, size) in [("shorter", 0.8), ("longer", 1.2), ("unseen", 1.1)] {
        let mut specimen = tube::two_tubes(tube::ONE_END, 4e-3);
        let organ = &mut specimen.organs[0];
        let points = organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices).chain([&mut organ.base]);
        points.for_each(|p| p.x *= size);
        specimen.write(&dir.path().join(name)).unwrap();
    }
    let mut varied = Scene::read(&file.display().to_string()).unwrap();
    let paths = ["tube", "shorter", "longer", "unseen"].map(str::to_owned).to_vec();
    varied.variation.specimens = Some(Specimens { paths, phantoms: Vec::new(), seeds: [1, 1] });
    varied.variation.swapped = vec!["tube".to_owned()];
    std::fs::write(&file, varied.to_toml().unwrap()).unwrap();
    let folder = dir.path().join("campaign");
    let by = vec!["organ".to_owned()];
    let result = Campaign { by, ..campaign(dir.path(), &["random"], 8) }.run(&folder, &Silent).unwrap();
    assert_eq!(result.episodes, 8);
    assert_eq!(result.by.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["specimen", "swapped.tube"]);
    let text = std::fs::read_to_string(folder.join("table.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let at = |name: &str| rows[0].iter().position(|head| *head == name).unwrap();
    let drawn: Vec<[&str; 2]> =
        rows[1..].iter().map(|row| [row[at("drawn.specimen")], row[at("drawn.swapped.tube")]]).collect();
    assert!(drawn.iter().all(|[own, other]| own != other && *other != "unseen"), "{drawn:?}");
    let mut pairs = drawn.clone();
    pairs.sort_unstable();
    pairs.dedup();
    assert!(pairs.len() > 2, "{pairs:?}");
    // Each episode has the tube of the other one, and its replay too; from a moved folder as well.
    for (k, [own, other]) in drawn.iter().enumerate().take(3) {
        let episode = folder.join(format!("episodes/random/{k:06}"));
        let result = std::fs::read_to_string(episode.join("result.json")).unwrap();
        assert!(result.contains(&format!("\"swapped.tube\": \"{other}\"")), "{result}");
        for place in [None, Some(dir.path().join(own))] {
            let verdict = trocar_workflow::replay(&episode, place.as_deref(), dir.path(), 1, &Silent).unwrap();
            assert!(verdict.same, "{own} {other}: {verdict:?}");
        }
        let elsewhere = dir.path().join(other);
        assert!(!trocar_workflow::replay(&episode, Some(&elsewhere), dir.path(), 1, &Silent).unwrap().same);
    }
}

#[test]
fn a_campaign_varies_unless_it_is_told_otherwise_and_shows_success_by_what_varied() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let folder = dir.path().join("campaign");
    let varied =
        || Campaign { split: Split::Both, variation: None, ..campaign(dir.path(), &["random", "scripted"], 8) };
    // It stops on the way and goes on with the same bits.
    let stopped = varied().run(&folder, &StopAfter::new(5)).unwrap_err().to_string();
    assert!(stopped.contains("continues"), "{stopped}");
    let result = varied().run(&folder, &Silent).unwrap();
    let whole = Campaign { jobs: 3, ..varied() }.run(&dir.path().join("whole"), &Silent).unwrap();
    assert_eq!((result.episodes, &result.hash, &result.by), (16, &whole.hash, &whole.by));
    assert_eq!((result.variation.name, result.variation.episodes.len()), ("standard", 8));
    assert_eq!(result.variation.episodes[7].seed, Split::FIRST_UNSEEN + 3);
    assert!(result.distinct_outcomes > 12, "{}", result.distinct_outcomes);
    let names: Vec<&str> = result.by.iter().map(|curve| curve.name.as_str()).collect();
    assert_eq!(names[..3], ["split", "specimen_shift_mm", "specimen_turn_deg"]);
    for curve in &result.by {
        for (k, row) in result.policies.iter().enumerate() {
            let shares = || curve.bins.iter().map(|bin| &bin.policies[k]);
            assert_eq!(shares().map(|s| s.episodes).sum::<usize>(), row.episodes, "{}", curve.name);
            assert_eq!(shares().map(|s| s.passed).sum::<usize>(), row.passed, "{}", curve.name);
        }
    }
    let modulus = result.by.iter().find(|curve| curve.name == "modulus_kpa").unwrap();
    assert_eq!((modulus.label.as_str(), modulus.log, modulus.bins.len()), ("modulus (kPa)", true, 2));
    let [low, middle, high] = modulus.bins[0].numbers.unwrap();
    assert!(3.0 <= low && low <= middle && middle <= high && high < modulus.bins[1].numbers.unwrap()[0]);
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    for said in
        ["The set standard varies", "Success by split", "<details><summary>16 episodes", "1000003", "modulus (kPa)"]
    {
        assert!(page.contains(said), "{said}");
    }
    // Only what is asked for.
    let modulus = Campaign { by: vec!["modulus".to_owned()], ..varied() }.run(&folder, &Silent).unwrap();
    assert_eq!((modulus.by.len(), modulus.hash), (1, result.hash));
    // Episodes of another kind are refused, and names before anything is made.
    for (other, said) in [
        (Campaign { split: Split::Seen, ..varied() }, "another split"),
        (Campaign { variation: Some(VariationSet::Easy), ..varied() }, "another variation"),
        (Campaign { by: vec!["modulous".to_owned()], ..varied() }, "did you mean 'modulus'?"),
    ] {
        let why = other.run(&folder, &Silent).unwrap_err().to_string();
        assert!(why.contains(said), "{why}");
    }
}

#[test]
fn episodes_that_repeat_others_are_counted_and_told() {
    let dir = TempDir::new().unwrap();
    let file = scene(dir.path());
    let mut fixed = Scene::read(&file.display().to_string()).unwrap();
    fixed.variation = trocar_scene::Variation::default();
    // The places of port-reach are drawn by the seed.
    fixed.task.name = TaskName::GraspLift;
    std::fs::write(&file, fixed.to_toml().unwrap()).unwrap();
    let folder = dir.path().join("campaign");
    // The scripted controller knows no seed, the random one does.
    let result = campaign(dir.path(), &["scripted", "random"], 4).run(&folder, &Silent).unwrap();
    let distinct: Vec<usize> = result.policies.iter().map(|p| p.distinct_outcomes).collect();
    assert_eq!((distinct[0], result.distinct_outcomes), (1, distinct.iter().sum()), "{distinct:?}");
    assert!(distinct[1] > 1, "{distinct:?}");
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains(&format!("Only {} of 8 episodes differ", result.distinct_outcomes)));
    // Nothing was grasped, so there is no lift.
    let text = std::fs::read_to_string(folder.join("table.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let lift = head.iter().position(|name| *name == "lift_mm").unwrap();
    assert!(lines.all(|row| row[lift].is_empty()), "{text}");
    let kept = std::fs::read(folder.join("episodes/scripted/000000/result.json")).unwrap();
    let kept: serde_json::Value = serde_json::from_slice(&kept).unwrap();
    assert!(["lift_mm", "slip_mm", "gap_mm", "snap_mm"].iter().all(|key| kept[*key].is_null()), "{kept}");
}

/// A campaign on two backends is a campaign on each, in its own folder, and their comparison.
#[test]
fn backends_are_compared_on_the_same_seeds() {
    let dir = TempDir::new().unwrap();
    scene(dir.path());
    let (campaign, output) = (campaign(dir.path(), &["scripted", "random"], 2), dir.path().join("both"));
    let both = campaign.run_on(&BackendName::ALL, None, &output, &Silent).unwrap();
    let names: Vec<&str> = both.backends.iter().map(|of| of.backend.name()).collect();
    assert_eq!(names, ["tetrahedra", "lattice"]);
    let [agreement] = &both.agreements[..] else { panic!("{:?}", both.agreements) };
    assert_eq!(agreement.policies.iter().map(|p| p.seeds).collect::<Vec<_>>(), [2, 2]);
    // The physics differs, and so do the final states.
    assert_ne!(both.backends[0].result.hash, both.backends[1].result.hash);
    let alone = Campaign { backend: Some(BackendName::Lattice), ..campaign.clone() };
    assert_eq!(alone.run(&dir.path().join("alone"), &Silent).unwrap().hash, both.backends[1].result.hash);
    for file in ["backends.json", "report.html", "tetrahedra/report.html", "lattice/report.html"] {
        assert!(output.join(file).is_file(), "{file}");
    }
    for backends in [&[BackendName::Lattice][..], &[BackendName::Lattice, BackendName::Lattice]] {
        let said = campaign.run_on(backends, None, &output, &Silent).unwrap_err().to_string();
        assert!(said.contains("--backend"), "{said}");
    }
    // Another backend is another campaign.
    let said = alone.run(&output.join("tetrahedra"), &Silent).unwrap_err().to_string();
    assert!(said.contains("campaign"), "{said}");
}
