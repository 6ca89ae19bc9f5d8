//! `trocar evaluate`: repeats and any number of jobs give the same results; campaigns are killed
//! and resumed; other folders are refused; policies fail.
//!
//! `TROCAR_TEST_KILLS=50` kills more often.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;
use trocar_remote::{Array, Call, Loopback, LoopbackOptions, Map, Value};
use trocar_scene::EpisodeRandom;
use trocar_testing::tube;

/// A coarse tube on disk, and a scene of it in which arms reach for `seconds`, without cameras.
fn scene(folder: &Path, seconds: f64) -> PathBuf {
    tube::reach(folder, &format!("reach-{seconds}.toml"), seconds, &[])
}

fn evaluate(scene: &Path, output: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trocar"));
    command.args(["-q", "--json", "evaluate"]).arg(scene).arg("-o").arg(output).args(more);
    command
}

fn json(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn table(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("table.csv")).unwrap()
}

/// The stored episodes, with the times of their results.
fn kept(folder: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let mut all = BTreeMap::new();
    for policy in std::fs::read_dir(folder.join("episodes")).into_iter().flatten() {
        for episode in std::fs::read_dir(policy.unwrap().path()).unwrap() {
            let result = episode.unwrap().path().join("result.json");
            // A folder with its final name has all files.
            let written = std::fs::metadata(&result).unwrap().modified().unwrap();
            all.insert(result, written);
        }
    }
    all
}

const TWO: [&str; 4] = ["--policy", "scripted", "--policy", "random"];

#[test]
fn campaigns_are_the_same_twice_and_with_any_number_of_jobs() {
    let dir = TempDir::new().unwrap();
    let scene = scene(dir.path(), 1.5);
    let run = |name: &str, jobs: &str| {
        let folder = dir.path().join(name);
        let more = [&TWO[..], &["--episodes", "4", "--jobs", jobs]].concat();
        let result = json(&evaluate(&scene, &folder, &more).output().unwrap());
        (result["hash"].as_str().unwrap().to_owned(), table(&folder))
    };
    let (hash, first) = run("one", "1");
    assert_eq!(first.lines().count(), 9, "{first}");
    assert_eq!((hash.clone(), first.clone()), run("two", "2"));
    // Finished episodes are not run again, and more episodes can follow.
    let before = kept(&dir.path().join("one"));
    assert_eq!((hash.clone(), first), run("one", "1"));
    assert_eq!(before, kept(&dir.path().join("one")));
    let more = [&TWO[..], &["--episodes", "6"]].concat();
    let longer = json(&evaluate(&scene, &dir.path().join("one"), &more).output().unwrap());
    assert_eq!((&longer["episodes"], &longer["planned"]), (&12.into(), &12.into()));
    assert_ne!(longer["hash"], hash);
    assert!(before.iter().all(|(path, time)| kept(&dir.path().join("one"))[path] == *time));
}

#[test]
fn a_campaign_that_is_killed_loses_nothing_and_repeats_nothing() {
    let kills: u64 = std::env::var("TROCAR_TEST_KILLS").map_or(8, |n| n.parse().unwrap());
    let dir = TempDir::new().unwrap();
    let scene = scene(dir.path(), 1.0);
    let episodes = (2 * kills).to_string();
    let more = [&TWO[..], &["--jobs", "2", "--episodes", &episodes]].concat();
    let (whole, broken) = (dir.path().join("whole"), dir.path().join("broken"));
    let clock = std::time::Instant::now();
    let unbroken = json(&evaluate(&scene, &whole, &more).output().unwrap());
    // The start takes much of the time, so most kills hit running episodes and some hit the start.
    let each = clock.elapsed().mul_f64(2.5 / kills as f64);
    let random = EpisodeRandom::new(7, "kills");
    let (mut seen, mut under_way): (BTreeMap<PathBuf, SystemTime>, usize) = (BTreeMap::new(), 0);
    for kill in 0..kills {
        let mut child = evaluate(&scene, &broken, &more).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let most = each.max(Duration::from_millis(300));
        std::thread::sleep(most.mul_f64(random.unit(kill)));
        // The process was ended by SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        let now = kept(&broken);
        for (path, time) in &seen {
            assert_eq!(now.get(path), Some(time), "{} was lost or done again", path.display());
        }
        let half = std::fs::read_dir(broken.join("under-way")).map_or(0, Iterator::count);
        under_way += usize::from(half > 0);
        seen = now;
    }
    let resumed = json(&evaluate(&scene, &broken, &more).output().unwrap());
    println!(
        "{kills} kills, {} of {} episodes kept before the last start, {under_way} with files under way",
        seen.len(),
        4 * kills
    );
    assert!(seen.iter().all(|(path, time)| kept(&broken)[path] == *time));
    assert_eq!(table(&whole), table(&broken));
    assert_eq!((&unbroken["hash"], &unbroken["policies"]), (&resumed["hash"], &resumed["policies"]));
}

#[test]
fn other_folders_scenes_and_seeds_are_refused_in_one_line() {
    let dir = TempDir::new().unwrap();
    let (short, long) = (scene(dir.path(), 0.5), scene(dir.path(), 0.6));
    let folder = dir.path().join("campaign");
    let one = ["--policy", "random", "--episodes", "1"];
    json(&evaluate(&short, &folder, &one).output().unwrap());
    let refused = |scene: &Path, folder: &Path, more: &[&str], why: &str| {
        let output = evaluate(scene, folder, &[&one[..], more].concat()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.success(), said.lines().count()), (false, 1), "{said}");
        assert!(said.contains(why), "{said}");
    };
    let foreign = dir.path().join("foreign");
    std::fs::create_dir(&foreign).unwrap();
    std::fs::write(foreign.join("thesis.txt"), "mine").unwrap();
    refused(&short, &foreign, &[], "no campaign");
    assert_eq!(std::fs::read_dir(&foreign).unwrap().count(), 1, "it was written to");
    refused(&long, &folder, &[], "another scene");
    refused(&short, &folder, &["--seed", "1"], "another seed");
    refused(&short, &folder, &["--split", "unseen"], "another split");
    refused(&short, &folder, &["--variation", "none"], "another variation");
    refused(&short, &folder, &["--by", "frction"], "did you mean 'friction'?");
    refused(&short, &folder, &["--policy", "genius"], "genius");
    // An invalid address is an error and no failed episode.
    for (address, why) in [("a=ws://", "host"), ("ws://h:0", "port"), ("ws://user:word@h", "TROCAR_POLICY_KEY")] {
        refused(&short, &folder, &["--policy", address], why);
    }
    let other = ["--policy", "random=scripted"];
    let output = evaluate(&short, &folder, &other).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stderr).contains("another policy named 'random'"));
    std::fs::write(folder.join("episodes/random/000000/result.json"), "{").unwrap();
    refused(&short, &folder, &[], "damaged episode");
    std::fs::write(folder.join("campaign.json"), "{").unwrap();
    refused(&short, &folder, &[], "campaign.json");
}

/// A chunk of `rows` actions of `dim` numbers equal to `value`.
fn chunk(rows: usize, dim: usize, value: f64) -> Result<Map, String> {
    let array = Array::from_f64(&[rows, dim], &vec![value; rows * dim]).map_err(|e| e.to_string())?;
    Ok(Map::from([("actions".to_owned(), Value::from(array))]))
}

#[test]
fn a_policy_that_fails_ends_its_episode_and_the_campaign_goes_on() {
    let dir = TempDir::new().unwrap();
    let scene = scene(dir.path(), 0.5);
    // Each seed makes another mistake in the second chunk, after the episode has begun.
    let server = Loopback::start(&LoopbackOptions::default(), |call| {
        let Call::Infer(map) = call else { return Ok(Map::new()) };
        let number = |name: &str| match map.get(name) {
            Some(Value::Int(n)) => *n,
            other => panic!("{name} is {other:?}"),
        };
        match (number("episode/step") > 0, number("episode/seed")) {
            (true, 1) => Err("out of memory".to_owned()),
            (true, 2) => {
                std::thread::sleep(Duration::from_secs(5));
                chunk(1, 10, 0.0)
            }
            (true, 3) => chunk(8, 7, 0.0),
            (true, 4) => chunk(8, 10, f64::NAN),
            (true, 5) => chunk(5000, 10, 0.0),
            (true, 6) => chunk(300_000, 10, 0.0),
            (true, 7) => Ok(Map::new()),
            _ => chunk(8, 10, 0.1),
        }
    })
    .unwrap();
    let folder = dir.path().join("hostile");
    let policy = format!("mine={}", server.url());
    let mut command = evaluate(&scene, &folder, &["--policy", &policy, "--episodes", "9", "--jobs", "1"]);
    let result = json(&command.env("TROCAR_POLICY_TIMEOUT_S", "2").output().unwrap());
    assert_eq!(
        result["policies"][0]["ends"],
        serde_json::json!({"passed": 0, "time-out": 2, "rcm-abort": 0, "diverged": 0, "policy-error": 7, "finished": 0}),
        "{result}"
    );
    for (seed, why) in [
        (1, "out of memory"),
        (2, "after 2 s"),
        (3, "7"),
        (4, "NaN"),
        (5, "5000"),
        (6, "byte"),
        (7, "no field 'actions'"),
    ] {
        let text = std::fs::read(folder.join(format!("episodes/mine/{seed:06}/result.json"))).unwrap();
        let episode: serde_json::Value = serde_json::from_slice(&text).unwrap();
        let said = episode["end"]["why"].as_str().unwrap();
        println!("seed {seed}: {said}");
        assert!(said.contains(why) && !said.contains('\n'), "seed {seed}: {said}");
        assert!(episode["duration_s"].as_f64().unwrap() > 0.0);
    }
    // After the server's end, finished episodes stay, and it is not asked for them.
    let url = server.url();
    drop(server);
    let before = table(&folder);
    let again = json(&evaluate(&scene, &folder, &["--policy", &policy, "--episodes", "9"]).output().unwrap());
    assert_eq!((&again["hash"], before), (&result["hash"], table(&folder)));
    let gone = dir.path().join("gone");
    // A server that is not there is reported before anything is built.
    let output = evaluate(&scene, &gone, &["--policy", &url, "--episodes", "1"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot connect") && said.lines().count() == 1 && !gone.exists(), "{said}");
    // A failure on the way is in the page and in the text, with the remedy.
    let server = Loopback::start(&LoopbackOptions::default(), |_| Err("out of memory".to_owned())).unwrap();
    let url = server.url();
    let mut command = Command::new(env!("CARGO_BIN_EXE_trocar"));
    command.args(["-q", "evaluate"]).arg(&scene).arg("-o").arg(&gone).args(["--policy", &url, "--episodes", "1"]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && said.contains("out of memory") && said.contains("--retry-failed"), "{said}");
    assert!(std::fs::read_to_string(gone.join("report.html")).unwrap().contains("out of memory"));
    // An episode without a step has no figures, and gives its reason once.
    let mut command = Command::new(env!("CARGO_BIN_EXE_trocar"));
    command.args(["-q", "episode"]).arg(&scene).arg("-o").arg(dir.path().join("none")).args(["--policy", &url]);
    let said = String::from_utf8(command.output().unwrap().stdout).unwrap();
    assert!(said.contains("left: nothing was measured") && !said.contains(" N"), "{said}");
    assert_eq!(said.matches("the policy failed").count(), 1, "{said}");
    let page = std::fs::read_to_string(dir.path().join("none/report.html")).unwrap();
    assert!(page.contains("out of memory") && !page.contains("Peak force"));
}

#[cfg(unix)]
#[test]
fn an_interrupted_campaign_says_what_is_kept_and_how_to_go_on() {
    let dir = TempDir::new().unwrap();
    let scene = scene(dir.path(), 1.0);
    let folder = dir.path().join("campaign");
    let more = ["--policy", "random", "--episodes", "1000", "--jobs", "1"];
    let mut command = evaluate(&scene, &folder, &more);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = std::time::Instant::now();
    while !folder.join("episodes/random/000001").exists() {
        assert!(child.try_wait().unwrap().is_none() && begun.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{said}");
    let kept = kept(&folder).len();
    assert!(said.contains(&format!("{kept} of 1000 episodes are finished")) && said.contains("continues"), "{said}");
    assert_eq!(table(&folder).lines().count(), 1 + kept);
}
