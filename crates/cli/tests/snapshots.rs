//! Texts of the program: help of every command, errors, and report pages. `INSTA_UPDATE=always
//! cargo test -p trocar-cli --test snapshots` writes the files of `tests/snapshots` again; read the
//! difference before you commit it.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;
use trocar_testing::tube;

/// Runs the program in `folder`, without a terminal and without the user's settings.
fn trocar(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trocar"));
    for name in ["COLUMNS", "TROCAR_PHANTOMS", "TROCAR_POLICY_KEY", "TROCAR_POLICY_TIMEOUT_S", "ORT_DYLIB_PATH"] {
        command.env_remove(name);
    }
    command.env("TROCAR_PYTHON", "no-such-python").current_dir(folder).args(arguments);
    command.stdin(Stdio::null()).output().unwrap()
}

fn check(name: &str, text: &str) {
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(name, text));
}

fn commands(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let name = |line: &str| line.strip_prefix("  ").filter(|l| !l.starts_with(' ')).map(str::to_owned);
    let names = listed.filter_map(name).filter_map(|line| line.split_whitespace().next().map(str::to_owned));
    names.filter(|name| name != "help").collect()
}

/// The pages of the docs that list commands.
fn lists_of_commands() -> String {
    let guides = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guides");
    ["commands.md", "studies.md"].map(|page| std::fs::read_to_string(guides.join(page)).unwrap()).concat()
}

#[test]
fn every_command_has_help_and_is_in_the_docs() {
    let (here, lists) = (TempDir::new().unwrap(), lists_of_commands());
    let mut open: Vec<Vec<String>> = vec![Vec::new()];
    let mut count = 0;
    while let Some(path) = open.pop() {
        let mut arguments: Vec<&str> = path.iter().map(String::as_str).collect();
        arguments.push("--help");
        let help = String::from_utf8(trocar(here.path(), &arguments).stdout).unwrap().replace("trocar.exe", "trocar");
        assert!(
            lists.contains(&["trocar", &path.join(" ")].join(" ")),
            "the docs do not list `trocar {}`",
            path.join(" ")
        );
        open.extend(commands(&help).into_iter().map(|name| [&path[..], &[name]].concat()));
        check(&["help".to_owned()].iter().chain(&path).cloned().collect::<Vec<_>>().join("-"), &help);
        count += 1;
    }
    assert!(count > 30, "{count} commands");
}

/// A folder of valid and invalid inputs.
fn inputs() -> TempDir {
    let here = TempDir::new().unwrap();
    let at = |name: &str| here.path().join(name);
    tube::reach(here.path(), "reach.toml", 0.5, &["endoscope"]);
    let scene = |more: &str| format!("name = 'mine'\n[specimen]\nphantom = 'phantom-a'\n{more}");
    std::fs::write(at("unit.toml"), scene("[safety]\nrcm_abort_mm = 0.005\n")).unwrap();
    std::fs::write(at("key.toml"), scene("[safety]\nrcm_abort = 5\n")).unwrap();
    std::fs::write(at("nan.toml"), scene("[task]\nepisode_s = nan\n")).unwrap();
    std::fs::write(at("organ.toml"), scene("[task]\norgan = 'apendix'\n")).unwrap();
    std::fs::write(at("syntax.toml"), "name = 'mine\n").unwrap();
    std::fs::create_dir(at("mine")).unwrap();
    std::fs::write(at("mine/thesis.tex"), "precious").unwrap();
    std::fs::write(at("damaged.stl"), "solid nothing\nfacet").unwrap();
    std::fs::write(at("damaged.trocar"), "no episode").unwrap();
    std::fs::write(at("result.json"), "{\n  \"scene\": \"mine\"\n}\n").unwrap();
    let reach = std::fs::read_to_string(at("reach.toml")).unwrap();
    let deep = reach.replacen("insertion_mm = 100.0", "insertion_mm = 160.0", 1);
    assert_ne!(deep, reach);
    std::fs::write(at("start.toml"), deep).unwrap();
    here
}

/// Paths and error texts of other systems differ from those of Unix.
#[cfg(unix)]
#[test]
fn errors_of_wrong_inputs() {
    let here = inputs();
    let cases: &[(&str, &[&str])] = &[
        ("command", &["reconstuct", "recording", "-o", "out"]),
        ("record-phantom", &["record", "phantom-z", "-o", "out"]),
        ("record-frames", &["record", "phantom-a", "--frames", "0", "-o", "out"]),
        ("inspect-missing", &["inspect", "nowhere"]),
        ("inspect-foreign", &["inspect", "mine"]),
        ("segment-output", &["segment", "nowhere"]),
        ("reconstruct-missing", &["reconstruct", "nowhere", "-o", "out"]),
        ("reconstruct-damaged-surface", &["reconstruct", "--surface", "damaged.stl", "--units", "mm", "-o", "out"]),
        ("reconstruct-without-units", &["reconstruct", "--surface", "damaged.stl", "-o", "out"]),
        ("reconstruct-wrong-unit", &["reconstruct", "--surface", "damaged.stl", "--units", "inch", "-o", "out"]),
        ("scene-missing", &["scene", "check", "nowhere.toml"]),
        ("scene-folder", &["scene", "check", "tube"]),
        ("scene-start", &["scene", "check", "start.toml"]),
        ("task-folder", &["task", "show", "mine"]),
        ("episode-folder", &["episode", "tube", "-o", "out"]),
        ("episode-start", &["episode", "start.toml", "-o", "out"]),
        ("episode-server", &["episode", "reach.toml", "--policy", "ws://127.0.0.1:1", "-o", "out"]),
        ("evaluate-folder", &["evaluate", "mine", "-o", "out"]),
        ("evaluate-server", &["evaluate", "reach.toml", "--policy", "mine=ws://127.0.0.1:1", "-o", "out"]),
        ("view-missing", &["view", "nowhere.toml", "--no-open"]),
        ("view-foreign", &["view", "mine", "--no-open"]),
        ("scene-builtin", &["scene", "show", "cell-d"]),
        ("scene-unit", &["scene", "check", "unit.toml"]),
        ("scene-key", &["scene", "check", "key.toml"]),
        ("scene-nan", &["scene", "check", "nan.toml"]),
        ("scene-organ", &["scene", "check", "organ.toml"]),
        ("scene-syntax", &["scene", "check", "syntax.toml"]),
        ("scene-new-organ", &["scene", "new", "tube", "--organ", "liver"]),
        ("scene-new-missing", &["scene", "new", "nowhere"]),
        ("simulate-missing", &["simulate", "nowhere", "-o", "out"]),
        ("simulate-organ", &["simulate", "tube", "--organ", "liver", "-o", "out"]),
        ("simulate-at", &["simulate", "tube", "--at", "2", "-o", "out"]),
        ("simulate-lift-nan", &["simulate", "tube", "--lift", "NaN", "-o", "out"]),
        ("simulate-jaw-force", &["simulate", "tube", "--jaw-force", "-1", "-o", "out"]),
        ("simulate-output", &["simulate", "tube", "-o", "mine"]),
        // Before its phantom is made.
        ("render-camera", &["render", "cell-a", "--camera", "endoskop", "--phantoms", "phantoms", "-o", "out.png"]),
        ("render-specimen-camera", &["render", "tube", "--camera", "endoscope", "-o", "out.png"]),
        ("render-ending", &["render", "tube", "-o", "out.gif"]),
        ("render-size", &["render", "tube", "--size", "big", "-o", "out.png"]),
        ("render-samples", &["render", "tube", "--samples", "4", "-o", "out.png"]),
        ("render-at", &["render", "reach.toml", "--at", "-1", "-o", "out.png"]),
        ("episode-policy", &["episode", "reach.toml", "--policy", "genius", "-o", "out"]),
        ("episode-python-name", &["episode", "reach.toml", "--policy", "python:mine.py", "-o", "out"]),
        ("episode-no-python", &["episode", "reach.toml", "--policy", "python:mine.py:act", "-o", "out"]),
        ("episode-output", &["episode", "reach.toml", "-o", "mine"]),
        ("replay-missing", &["replay", "nowhere"]),
        ("replay-foreign", &["replay", "result.json"]),
        ("replay-specimen", &["replay", "damaged.trocar", "--specimen", "tube"]),
        ("sweep-foreign", &["sweep", "result.json", "--gate", "lift_mm=1..3"]),
        ("replay-damaged", &["replay", "damaged.trocar"]),
        ("sweep-gate", &["sweep", "nowhere", "--gate", "height_mm=1..3"]),
        ("sweep-values", &["sweep", "nowhere", "--gate", "lift_mm=NaN"]),
        ("evaluate-episodes", &["evaluate", "reach.toml", "--episodes", "0", "-o", "out"]),
        ("evaluate-twice", &["evaluate", "reach.toml", "--policy", "random", "--policy", "random", "-o", "out"]),
        ("evaluate-address", &["evaluate", "reach.toml", "--policy", "ws://h:0", "-o", "out"]),
        ("evaluate-output", &["evaluate", "reach.toml", "-o", "mine"]),
    ];
    let before = std::fs::read_dir(here.path()).unwrap().count();
    for (name, arguments) in cases {
        let output = trocar(here.path(), arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        let said = said.replace(&here.path().canonicalize().unwrap().display().to_string(), "DIR");
        let said = said.replace(&here.path().display().to_string(), "DIR");
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert!(output.stdout.is_empty(), "{name}");
        check(&format!("error-{name}"), &format!("$ trocar {}\n{said}", arguments.join(" ")));
    }
    assert_eq!(std::fs::read_dir(here.path()).unwrap().count(), before, "a wrong input leaves nothing");
}

/// The texts of a page, one per line, without style sheet and pictures, with `#` for every number.
fn texts(html: &str) -> String {
    let mut rest = html.to_owned();
    for (from, to) in [("<style", "</style>"), ("<svg", "</svg>")] {
        while let Some(start) = rest.find(from) {
            let end = rest[start..].find(to).map_or(rest.len(), |n| start + n + to.len());
            rest.replace_range(start..end, "");
        }
    }
    let mut text = String::new();
    let mut in_tag = false;
    for c in rest.chars() {
        match c {
            '<' => in_tag = true,
            '>' => {
                in_tag = false;
                text.push('\n');
            }
            c if !in_tag => text.push(c),
            _ => {}
        }
    }
    let is_hash = |line: &str| line.len() == 16 && line.chars().all(|c| c.is_ascii_hexdigit());
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.map(|line| if is_hash(line) { "HASH".to_owned() } else { without_numbers(line) } + "\n").collect()
}

/// The line with `#` for every number, whatever its sign, decimals and exponent.
fn without_numbers(line: &str) -> String {
    let chars: Vec<char> = line.chars().collect();
    let digit = |k: usize| chars.get(k).is_some_and(char::is_ascii_digit);
    let mut out = String::new();
    let mut k = 0;
    while let Some(c) = chars.get(k).copied() {
        let signed =
            matches!(c, '-' | '\u{2212}') && digit(k + 1) && !out.ends_with(|p: char| p.is_alphanumeric() || p == '#');
        if !signed && !digit(k) {
            out.push(c);
            k += 1;
            continue;
        }
        k += usize::from(signed);
        while digit(k) || (chars.get(k) == Some(&'.') && digit(k + 1)) {
            k += 1;
        }
        if chars.get(k) == Some(&'e') && (digit(k + 1) || (chars.get(k + 1) == Some(&'-') && digit(k + 2))) {
            k += 2;
            while digit(k) {
                k += 1;
            }
        }
        out.push('#');
    }
    out
}

#[test]
fn numbers_are_left_out() {
    assert_eq!(without_numbers("RCM 0.12 mm, \u{2212}3.5e-17 N, s = 1."), "RCM # mm, # N, s = #.");
    assert_eq!(without_numbers("reach-1 in cell-a, 12\u{2013}50 %"), "reach-# in cell-a, #\u{2013}# %");
}

#[test]
fn pages_of_an_episode_and_of_a_campaign() {
    let here = inputs();
    let run = |arguments: &[&str]| {
        let output = trocar(here.path(), arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let page = |name: &str| texts(&std::fs::read_to_string(here.path().join(name)).unwrap());
    let said = run(&["episode", "reach.toml", "--policy", "random", "-o", "episode"]);
    check("page-episode", &page("episode/report.html"));
    let last = |line: &&str| !line.contains("real time");
    check("text-episode", &without_numbers(&said.lines().filter(last).collect::<Vec<_>>().join("\n")));
    let said = run(&["evaluate", "reach.toml", "--policy", "random", "--episodes", "1", "-o", "campaign"]);
    check("page-campaign", &page("campaign/report.html"));
    let last = |line: &&str| !line.starts_with("states");
    check("text-campaign", &without_numbers(&said.lines().filter(last).collect::<Vec<_>>().join("\n")));
}
