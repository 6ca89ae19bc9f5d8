//! Campaigns on this machine: names with dots, damaged files, an interruption, options that cannot be, and what the table holds.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

#[path = "../../task/tests/common/mod.rs"]
mod common;

use std::path::{Path, PathBuf};
use std::sync::Barrier;
use std::sync::atomic::{AtomicUsize, Ordering};
use tempfile::TempDir;
use trocar_evaluate::{Campaign, Files, Job, Plan, PolicySpec, Store};
use trocar_progress::{Progress, Silent};
use trocar_scene::{SpecimenSource, TaskName};

/// A coarse tube on disk and a scene around it, in which arms reach for half a second; the endoscope alone looks on.
fn scene(folder: &Path) -> PathBuf {
    common::two_tubes(common::ONE_END, 4e-3).write(&folder.join("tube")).unwrap();
    let mut scene = common::resection();
    scene.specimen = SpecimenSource { path: Some("tube".to_owned()), phantom: None, seed: 1 };
    scene.task.name = TaskName::PortReach;
    scene.task.episode_s = 0.5;
    scene.cameras.retain(|c| c.name == "endoscope");
    let file = folder.join("reach.toml");
    std::fs::write(&file, scene.to_toml().unwrap()).unwrap();
    file
}

fn campaign(folder: &Path, policies: &[&str], episodes: usize) -> Campaign {
    Campaign {
        scene: folder.join("reach.toml").display().to_string(),
        policies: policies.iter().map(|p| PolicySpec::parse(p).unwrap()).collect(),
        episodes,
        seed: 0,
        jobs: 1,
        retry_failed: false,
        phantoms: folder.join("phantoms"),
    }
}

/// Asks to stop once so many units of work are done.
struct StopAfter(usize, AtomicUsize);

impl Progress for StopAfter {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, units: u64) {
        self.1.fetch_add(units as usize, Ordering::SeqCst);
    }
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.1.load(Ordering::SeqCst) >= self.0
    }
}

#[test]
fn episodes_of_names_with_dots_are_done_again_side_by_side() {
    let dir = TempDir::new().unwrap();
    let scene = trocar_scene::Scene::read(&scene(dir.path()).display().to_string()).unwrap();
    let specimen = common::two_tubes(common::ONE_END, 4e-3);
    let policies = ["v1.0=random", "v1.1=random"].map(|p| PolicySpec::parse(p).unwrap());
    let plan = Plan::new(&scene, &specimen, &policies, 40, 0).unwrap();
    let store = Store::open(&dir.path().join("campaign"), &plan).unwrap();
    let jobs: Vec<Job> = plan.jobs().collect();
    let next = AtomicUsize::new(0);
    let together = Barrier::new(4);
    // Twice: what is there goes aside the second time.
    let work = || -> trocar_evaluate::Result<()> {
        together.wait();
        loop {
            let k = next.fetch_add(1, Ordering::SeqCst);
            let Some(job) = jobs.get(k % jobs.len()).filter(|_| k < 6 * jobs.len()) else { return Ok(()) };
            let text = format!("{k}").into_bytes();
            store.put(job, &Files(vec![("result.json".to_owned(), text)]))?;
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
            let _ = std::fs::remove_dir_all(folder.join("pictures"));
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
        let why = campaign(dir.path(), &two, 3).run(&folder, &StopAfter(most, AtomicUsize::new(0))).unwrap_err();
        let said = format!("{kept} of 6 episodes are kept");
        assert!(why.to_string().contains(&said) && why.to_string().contains("goes on"), "{why}");
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
