//! What policies learn: the examples in Python record demonstrations, train on them, and are
//! evaluated on unseen episodes. It takes about an hour.

use super::{Trocar, WORK, absolute, tables, write};
use serde_json::Value;
use std::fmt::Write;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The virtual environment, and what is installed there besides the package.
const ENVIRONMENT: &str = "target/learning";
const PACKAGES: [&str; 4] = ["lerobot==0.4.4", "stable-baselines3>=2.4", "matplotlib", ".[datasets,policies]"];

const SCENE: &str = "examples/python/lift_from_pictures.toml";
const RECORD: &str = "examples/python/record_demonstrations.py --episodes 300 --keep 200 --seconds 9 --size 84 \
                      --noise 0.5 --variation standard --threads 1";
const CLONE: &str = "examples/python/train_from_pictures.py --steps 1000 --threads 1";
const REINFORCE: &str = "examples/python/train_grasp_lift.py";
/// LeRobot's ACT at a small size.
const ACT: &str = "--dataset.repo_id=local/lifts --dataset.video_backend=pyav --policy.type=act --policy.device=cpu \
                   --policy.push_to_hub=false --policy.pretrained_backbone_weights=null --policy.pre_norm=true \
                   --policy.dim_model=128 --policy.n_heads=4 --policy.dim_feedforward=512 \
                   --policy.n_encoder_layers=2 --policy.n_vae_encoder_layers=2 --policy.latent_dim=16 \
                   --policy.chunk_size=24 --policy.n_action_steps=8 --policy.optimizer_lr=3e-4 \
                   --policy.optimizer_lr_backbone=3e-4 --batch_size=16 --num_workers=0 --steps=900 --seed=0";
const PORT: &str = "8123";
/// What cloned policies observe, and their seeds.
const OBSERVED: [&str; 2] = ["pictures", "states"];
const SEEDS: [&str; 3] = ["0", "1", "2"];
const EPISODES: &str = "20";

/// Records, trains, evaluates, and writes the table and the curves.
pub fn run(trocar: &Trocar) -> Result<(), String> {
    let python = Python::new()?;
    let (lifts, cloned, act) = (python.path("lifts"), python.path("cloned"), python.path("act"));
    python.run(&format!("{RECORD} --scene {SCENE} -o {lifts}"))?;
    for observe in OBSERVED {
        python.run(&format!("{CLONE} {lifts} -o {cloned} --observe {observe}"))?;
    }
    if !Path::new(&act).is_dir() {
        python.run(&format!("-m lerobot.scripts.lerobot_train --dataset.root={lifts} --output_dir={act} {ACT}"))?;
    }
    let trained = format!("{act}/checkpoints/last/pretrained_model");
    let server = python.start(&format!("examples/python/serve_lerobot.py {trained} --port {PORT} --threads 1"))?;
    let _server = Server::ready(server)?;
    let printed = evaluate(trocar, &python, &cloned)?;
    let table = table(&printed).ok_or("the evaluation printed no policies")?;
    write(&Path::new(tables::FOLDER).join("learning.md"), &(head() + &table))?;
    let curve = Path::new(&cloned).join("curve.png");
    std::fs::copy(&curve, "docs/pictures/learning-pictures.png").map_err(|e| format!("{}: {e}", curve.display()))?;
    python.run(&format!("{REINFORCE} -o docs/pictures/learning.png"))
}

/// Evaluates all policies on the same unseen episodes; returns the result as JSON.
fn evaluate(trocar: &Trocar, python: &Python, cloned: &str) -> Result<String, String> {
    let mut words = format!("evaluate {SCENE} --split unseen --episodes {EPISODES} --policy scripted");
    for (observe, seed) in OBSERVED.into_iter().flat_map(|o| SEEDS.map(|s| (o, s))) {
        let _ = write!(words, " --policy {observe}_{seed}=python:{cloned}/policies.py:{observe}_{seed}");
    }
    let _ = write!(words, " --policy act=ws://127.0.0.1:{PORT} --json --output {}", python.path("evaluated"));
    eprintln!("== trocar {words}");
    let mut command = Command::new(&trocar.0);
    command.args(words.split(' ')).env("TROCAR_PYTHON", &python.program).stdin(Stdio::null()).stderr(Stdio::inherit());
    let run = command.output().map_err(|e| format!("trocar: {e}"))?;
    if run.status.success() {
        Ok(String::from_utf8_lossy(&run.stdout).into_owned())
    } else {
        Err("the evaluation failed".to_owned())
    }
}

/// The commit of the repository.
fn commit() -> String {
    let run = Command::new("git").args(["rev-parse", "--short=8", "HEAD"]).output();
    run.map_or_else(|_| "unknown".to_owned(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

/// The first lines of the table.
fn head() -> String {
    let commit = commit();
    format!(
        "<!-- cargo xtask figures learning; commit {commit} -->\n\nThe commands of `cargo xtask figures learning` at commit \
         {commit}: {EPISODES} unseen episodes of each policy, all on the same seeds.\n\n"
    )
}

/// The table of policies in the result of `trocar evaluate`.
fn table(json: &str) -> Option<String> {
    let result: Value = serde_json::from_str(json.lines().last()?).ok()?;
    let mut table =
        "| Policy | Attached | Held to the end | Passed | Interval (95%) |\n| --- | --: | --: | --: | --: |\n"
            .to_owned();
    for policy in result["policies"].as_array()? {
        let number = |key: &str| policy[key].as_u64();
        let share = |key: &str| policy["interval"][key].as_f64().map(|share| (100.0 * share).round());
        let (episodes, attached) = (number("episodes")?, number("attached")?);
        let _ = writeln!(
            table,
            "| {} | {attached} of {episodes} | {} of {attached} | {} of {episodes} | {} to {}% |",
            policy["policy"].as_str()?,
            number("held_to_end")?,
            number("passed")?,
            share("low")?,
            share("high")?
        );
    }
    Some(table)
}

/// The Python of the environment, and the folder of its files.
struct Python {
    program: PathBuf,
    folder: PathBuf,
}

impl Python {
    fn new() -> Result<Self, String> {
        // Of this commit: what another program recorded or trained is not used again.
        let folder = absolute(&Path::new(WORK).join(format!("{}-{}", super::LEARNING, commit())))?;
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let python = Self { program: absolute(&Path::new(ENVIRONMENT).join("bin/python"))?, folder };
        let made = Command::new("python3").args(["-m", "venv", ENVIRONMENT]).status();
        if !made.is_ok_and(|s| s.success()) {
            return Err(format!("python3 -m venv {ENVIRONMENT} failed"));
        }
        python.run(&format!("-m pip install --quiet {}", PACKAGES.join(" ")))?;
        Ok(python)
    }

    /// The path of a file in the folder.
    fn path(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    fn start(&self, words: &str) -> Result<Child, String> {
        eprintln!("== python {words}");
        let mut command = Command::new(&self.program);
        // With two threads LeRobot's trainer takes 6 s a step beside other work, with one 0.8 s.
        command.args(words.split_whitespace()).env("OMP_NUM_THREADS", "1").stdin(Stdio::null());
        command.spawn().map_err(|e| format!("python: {e}"))
    }

    fn run(&self, words: &str) -> Result<(), String> {
        let status = self.start(words)?.wait();
        if status.is_ok_and(|s| s.success()) { Ok(()) } else { Err(format!("python {words} failed")) }
    }
}

/// A policy server that ends with this value.
struct Server(Child);

impl Server {
    /// The server, once it answers.
    fn ready(child: Child) -> Result<Self, String> {
        let server = Self(child);
        for _ in 0..120 {
            if TcpStream::connect(format!("127.0.0.1:{PORT}")).is_ok() {
                return Ok(server);
            }
            std::thread::sleep(Duration::from_secs(1));
        }
        Err(format!("the policy server does not answer at port {PORT}"))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_a_row_for_each_policy() {
        let json = r#"{"policies":[{"policy":"act","episodes":20,"attached":2,"held_to_end":1,"passed":0,
            "interval":{"share":0.0,"low":0.0,"high":0.161}}]}"#;
        let table = table(&json.replace('\n', "")).unwrap();
        assert!(table.ends_with("| act | 2 of 20 | 1 of 2 | 0 of 20 | 0 to 16% |\n"), "{table}");
        assert_eq!(super::table("{}"), None);
    }
}
