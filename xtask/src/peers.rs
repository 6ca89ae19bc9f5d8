//! Our stepping beside public solvers, on one mesh, in one run, on one machine: Newton's VBD (8
//! substeps of 10 iterations) and MuJoCo's flex (one step of 1/60 s a frame).
//!
//! The peers' scripts and meshes are beside the repository (`../shared/peers`) and are copied. The
//! peers come from PyPI into an environment of their own. Runs alternate, because a busy machine
//! must slow all of them. Every figure is the median over the rounds.
//!
//! MuJoCo's script and ours time as many frames. The peers' scripts know one motion, the organs
//! sagging from rest under gravity; ours is timed on the same sag, and on a drag of the appendix,
//! which is harder. The table says what each did. MuJoCo is timed without and with a pool of two
//! threads, and the faster counts. Newton's kernels on a CPU run on one thread with any setting, so
//! that is its best.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The packages that the peers need.
const PACKAGES: [&str; 5] = ["newton==1.8.0", "warp-lang==1.19.0", "mujoco==4.0.0", "meshio", "scipy"];
/// Where their scripts and meshes are, beside the repository.
const SCRIPTS: &str = "../shared/peers";
/// Where everything is put.
const FOLDER: &str = "target/peers";
/// The mesh: synthetic organs with the paper's counts of nodes and elements, not the paper's
/// specimen A.
const MESH: &str = "specimen_a";
/// Rounds of runs.
const ROUNDS: usize = 3;

type Outcome<T> = Result<T, String>;

/// One solver: what a round measures of it.
struct Solver {
    name: &'static str,
    /// Its threads, for people.
    threads: &'static str,
    /// Description of the timed work, for people.
    work: &'static str,
    run: fn(&Places) -> Outcome<Figures>,
}

/// Real-time factor by wall time, by CPU time of one thread where that is known, and error of the
/// static sag.
#[derive(Clone, Copy)]
struct Figures {
    wall: f64,
    cpu: Option<f64>,
    sag: f64,
}

/// Where things are.
struct Places {
    python: PathBuf,
    scripts: PathBuf,
    trocar: PathBuf,
    mesh: PathBuf,
}

const SOLVERS: [Solver; 11] = [
    Solver { name: "Newton 1.8 VBD, 8 x 10", threads: "1", work: "5 frames of sag", run: newton },
    Solver { name: "MuJoCo 4.0 flex, 1/60 s", threads: "1", work: SAG, run: |p| mujoco(p, "0") },
    Solver { name: "MuJoCo 4.0 flex, 1/60 s", threads: "2", work: SAG, run: |p| mujoco(p, "2") },
    Solver { name: "trocar, paper schedule", threads: "1", work: SAG, run: |p| sagging(p, "paper", "1") },
    Solver { name: "trocar, paper schedule", threads: "2", work: SAG, run: |p| sagging(p, "paper", "2") },
    Solver { name: "trocar, fast schedule", threads: "1", work: SAG, run: |p| sagging(p, "fast", "1") },
    Solver { name: "trocar, fast schedule", threads: "2", work: SAG, run: |p| sagging(p, "fast", "2") },
    Solver { name: "trocar, paper schedule", threads: "1", work: DRAG, run: |p| ours(p, "paper", "1") },
    Solver { name: "trocar, fast schedule", threads: "1", work: DRAG, run: |p| ours(p, "fast", "1") },
    Solver { name: "trocar, paper schedule", threads: "2", work: DRAG, run: |p| ours(p, "paper", "2") },
    Solver { name: "trocar, fast schedule", threads: "2", work: DRAG, run: |p| ours(p, "fast", "2") },
];

/// The work of our runs: the frames that `bench organs` times by default.
const DRAG: &str = "120 frames of drag";

/// What MuJoCo does, and ours beside it: the organs sag from rest under gravity.
const SAG: &str = "120 frames of sag";

/// Peers come first in [`SOLVERS`]: Newton, and MuJoCo without and with a pool of threads.
const PEERS: usize = 3;

/// Sets everything up, runs everything, prints the table and writes it to
/// `target/peers/table.json`.
pub fn run() -> Outcome<()> {
    let places = set_up()?;
    let mut measured: Vec<Vec<Outcome<Figures>>> = SOLVERS.iter().map(|_| Vec::new()).collect();
    for round in 1..=ROUNDS {
        for (solver, rows) in SOLVERS.iter().zip(&mut measured) {
            eprintln!("== round {round} of {ROUNDS}: {} ({} threads)", solver.name, solver.threads);
            let figures = (solver.run)(&places);
            if let Err(why) = &figures {
                eprintln!("   {why}");
            }
            rows.push(figures);
        }
    }
    let medians: Vec<Outcome<Figures>> = measured.into_iter().map(median).collect();
    let table = json!({ "mesh": MESH, "mesh_is": "synthetic, of the paper's counts", "rounds": ROUNDS, "rows": rows(&medians) });
    let text = serde_json::to_string_pretty(&table).map_err(|e| e.to_string())?;
    let path = Path::new(FOLDER).join("table.json");
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    print(&medians);
    eprintln!("\nwritten to {}", path.display());
    Ok(())
}

fn set_up() -> Outcome<Places> {
    let scripts = Path::new(SCRIPTS);
    if !scripts.join("bench_newton.py").is_file() {
        return Err(format!(
            "the peers' scripts and meshes are not at {SCRIPTS} beside the repository; without them there is nothing to compare with"
        ));
    }
    let folder = Path::new(FOLDER);
    let copy = folder.join("scripts");
    copied(scripts, &copy).map_err(|e| format!("{SCRIPTS} cannot be copied to {}: {e}", copy.display()))?;
    let environment = folder.join("venv");
    let python = environment.join("bin/python");
    let import = || quiet(Command::new(&python).args(["-c", "import newton, mujoco, meshio, scipy"]));
    if !import() {
        eprintln!("== {} into {}", PACKAGES.join(" "), environment.display());
        let made = quiet(Command::new("python3").args(["-m", "venv"]).arg(&environment))
            && quiet(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES));
        if !made || !import() {
            return Err("the peers cannot be installed; Python 3 with venv and a network are needed".to_owned());
        }
    }
    eprintln!("== trocar");
    if !crate::cargo(&["build", "--release", "--locked", "-p", "trocar-cli"], &[]) {
        return Err("trocar cannot be built".to_owned());
    }
    let absolute = |path: PathBuf| std::path::absolute(&path).map_err(|e| format!("{}: {e}", path.display()));
    Ok(Places {
        python: absolute(python)?,
        mesh: absolute(copy.join("meshes").join(format!("{MESH}.msh")))?,
        scripts: absolute(copy)?,
        trocar: absolute(PathBuf::from("target/release/trocar"))?,
    })
}

/// Copies a folder, files that are there already too; the copies may be written.
fn copied(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copied(&entry.path(), &target)?;
        } else {
            // Contents only: the originals may be read-only.
            std::fs::write(&target, std::fs::read(entry.path())?)?;
        }
    }
    Ok(())
}

fn newton(places: &Places) -> Outcome<Figures> {
    let arguments = ["bench_newton.py", "rt", "--mesh", MESH, "--warm", "10", "--frames", "5", "--save", "newton.npy"];
    peer(places, &arguments, "newton.npy")
}

fn mujoco(places: &Places, threads: &str) -> Outcome<Figures> {
    let arguments = [
        "bench_mujoco.py",
        "--mesh",
        MESH,
        "--dt",
        "0.0166667",
        "--mass",
        "lumped",
        "--sim",
        "2",
        "--threads",
        threads,
        "--save",
        "mujoco.npy",
    ];
    peer(places, &arguments, "mujoco.npy")
}

/// Runs a peer's script and compares the positions it saved with the static equilibrium.
fn peer(places: &Places, arguments: &[&str], saved: &str) -> Outcome<Figures> {
    let result = json_of(&output(Command::new(&places.python).args(arguments).current_dir(&places.scripts))?)?;
    if let Some(why) = result.get("error") {
        return Err(why.to_string());
    }
    let mut check = Command::new(&places.python);
    let text = output(check.args(["check_static.py", MESH, saved]).current_dir(&places.scripts))?;
    Ok(Figures {
        wall: number(&result, "rtf_median")?,
        cpu: Some(number(&result, "rtf_cpu_time")?),
        sag: after(&text, "err vs static mean")? / after(&text, "mean |u|")?,
    })
}

/// Ours on the same motion as MuJoCo's.
fn sagging(places: &Places, schedule: &str, threads: &str) -> Outcome<Figures> {
    timed(places, schedule, threads, "real_time_factor_sag")
}

/// Ours on the harder motion.
fn ours(places: &Places, schedule: &str, threads: &str) -> Outcome<Figures> {
    timed(places, schedule, threads, "real_time_factor")
}

fn timed(places: &Places, schedule: &str, threads: &str, key: &str) -> Outcome<Figures> {
    let mut command = Command::new(&places.trocar);
    command.args(["--json", "--quiet", "bench", "organs", "--schedule", schedule, "--threads", threads, "--mesh"]);
    let result = json_of(&output(command.arg(&places.mesh))?)?;
    let wall = number(&result, key)?;
    Ok(Figures { wall, cpu: (threads == "1").then_some(wall), sag: number(&result, "static_sag_error")? })
}

/// What a command printed.
fn output(command: &mut Command) -> Outcome<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let done = command.stdin(Stdio::null()).output().map_err(|e| format!("{name} could not be started: {e}"))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(format!("{name} failed: {}", said.trim_end().lines().last().unwrap_or("without a word")));
    }
    Ok(String::from_utf8_lossy(&done.stdout).into_owned())
}

/// The JSON object at the end of what a program printed (some print of themselves before it).
fn json_of(text: &str) -> Outcome<Value> {
    let starts = text.match_indices('{').map(|(at, _)| at);
    let mut objects = starts.filter_map(|at| serde_json::from_str::<Value>(&text[at..]).ok());
    objects.next().ok_or_else(|| "it printed no JSON object".to_owned())
}

fn number(value: &Value, key: &str) -> Outcome<f64> {
    value.get(key).and_then(Value::as_f64).ok_or_else(|| format!("it printed no number '{key}'"))
}

/// The first number after some words.
fn after(text: &str, words: &str) -> Outcome<f64> {
    let rest = text.split(words).nth(1).and_then(|rest| rest.split_whitespace().next());
    rest.and_then(|n| n.parse().ok()).ok_or_else(|| format!("it printed no number after '{words}'"))
}

/// The median of each figure; the first failure if there is one.
fn median(rounds: Vec<Outcome<Figures>>) -> Outcome<Figures> {
    let rounds: Vec<Figures> = rounds.into_iter().collect::<Outcome<_>>()?;
    let middle = |of: &dyn Fn(&Figures) -> f64| {
        let mut values: Vec<f64> = rounds.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        let half = values.len() / 2;
        if values.len() % 2 == 1 { values[half] } else { 0.5 * (values[half - 1] + values[half]) }
    };
    let cpu = rounds.iter().all(|f| f.cpu.is_some()).then(|| middle(&|f| f.cpu.unwrap_or_default()));
    Ok(Figures { wall: middle(&|f| f.wall), cpu, sag: middle(&|f| f.sag) })
}

/// Ours over a peer's: by CPU time on one thread, by wall time on all.
fn ratio(ours: &Figures, peer: &Figures) -> f64 {
    match (ours.cpu, peer.cpu) {
        (Some(a), Some(b)) => a / b,
        _ => ours.wall / peer.wall,
    }
}

/// Of MuJoCo's two thread settings the one with more frames a second.
fn faster<'a>(one: &'a Outcome<Figures>, two: &'a Outcome<Figures>) -> &'a Outcome<Figures> {
    match (one, two) {
        (Ok(a), Ok(b)) if b.wall > a.wall => two,
        (Err(_), Ok(_)) => two,
        _ => one,
    }
}

fn rows(medians: &[Outcome<Figures>]) -> Vec<Value> {
    let row = |(k, (solver, figures)): (usize, (&Solver, &Outcome<Figures>))| {
        let named = json!({ "solver": solver.name, "threads": solver.threads, "work": solver.work });
        let rest = match figures {
            Err(why) => json!({ "failure": why }),
            Ok(f) => {
                let over = |peer: &Outcome<Figures>| peer.as_ref().ok().filter(|_| k >= PEERS).map(|p| ratio(f, p));
                json!({
                    "real_time_factor": f.wall, "real_time_factor_cpu": f.cpu, "static_sag_error": f.sag,
                    "over_newton": over(&medians[0]), "over_mujoco": over(faster(&medians[1], &medians[2])),
                })
            }
        };
        let (Value::Object(mut named), Value::Object(rest)) = (named, rest) else { return Value::Null };
        named.extend(rest);
        Value::Object(named)
    };
    SOLVERS.iter().zip(medians).enumerate().map(row).collect()
}

fn print(medians: &[Outcome<Figures>]) {
    let fixed = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let times = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.1}x"));
    eprintln!(
        "\n{:<26} {:>7}  {:<18} {:>10} {:>10} {:>10} {:>10} {:>10}",
        "solver", "threads", "timed", "real time", "CPU time", "sag error", "Newton", "MuJoCo"
    );
    for (k, (solver, figures)) in SOLVERS.iter().zip(medians).enumerate() {
        match figures {
            Err(why) => eprintln!("{:<26} {:>7}  {:<18} {why}", solver.name, solver.threads, solver.work),
            Ok(f) => {
                let over =
                    |peer: &Outcome<Figures>| times(peer.as_ref().ok().filter(|_| k >= PEERS).map(|p| ratio(f, p)));
                eprintln!(
                    "{:<26} {:>7}  {:<18} {:>10} {:>10} {:>9.2}% {:>10} {:>10}",
                    solver.name,
                    solver.threads,
                    solver.work,
                    fixed(Some(f.wall)),
                    fixed(f.cpu),
                    100.0 * f.sag,
                    over(&medians[0]),
                    over(faster(&medians[1], &medians[2]))
                );
            }
        }
    }
    eprintln!(
        "real time, CPU time: simulated over wall time, over CPU time. Newton, MuJoCo: ours over theirs, by CPU time where ours ran on one thread."
    );
}

/// Runs a command without a word of it; says whether it went well.
fn quiet(command: &mut Command) -> bool {
    let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|s| s.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_peers_print_is_read() {
        let result = json_of("Warp 1.19 {cpu}\n{\n \"rtf_median\": 0.018, \"a\": {\"b\": 1}\n}\n").unwrap();
        assert_eq!(number(&result, "rtf_median"), Ok(0.018));
        assert!(number(&result, "rtf").is_err() && json_of("nothing").is_err());
        let text = "static linear   : mean |u|     5.20 um\nx.npy: mean |u| 46 um   err vs static mean 40.80 p99 1";
        assert_eq!((after(text, "mean |u|"), after(text, "err vs static mean")), (Ok(5.2), Ok(40.8)));
    }

    #[test]
    fn medians_and_ratios() {
        let figures = |wall, cpu| Ok(Figures { wall, cpu, sag: 0.1 });
        let ours = median(vec![figures(2.0, None), figures(4.0, None)]).unwrap();
        let peer = median(vec![figures(0.3, Some(0.1))]).unwrap();
        assert!((ratio(&ours, &peer) - 10.0).abs() < 1e-12);
        assert!(median(vec![figures(1.0, None), Err("no".to_owned())]).is_err());
    }
}
