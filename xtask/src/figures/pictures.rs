//! The pictures of the docs, and how each is made.

use super::sheet::sheet;
use super::{Trocar, WORK, read, write};
use std::path::Path;

/// Where the pictures are.
const FOLDER: &str = "docs/pictures";
/// Where phantoms are made.
const PHANTOMS: &str = "target/figures/phantoms";
/// Surfaces of real organs, beside the project. Pictures of them are skipped without it.
const DATA: &str = "../shared/data";
/// In a command: the episode of the task, and the specimen of phantom A.
const EPISODE: &str = "EPISODE";
const PHANTOM_A: &str = "PHANTOM-A";

/// A picture and how it is made.
struct Picture {
    /// The name of its file.
    file: &'static str,
    from: Source,
}

enum Source {
    /// Words of `trocar render`.
    Render(&'static str),
    /// Words of `trocar episode`, and of `trocar render` of that episode.
    Task(&'static str, &'static str),
    /// Words of `trocar bench render`.
    Bench(&'static str),
    /// Figures of the page of a study that has a table: how the titles of their sections begin
    /// (none for all), and how their names do.
    Study(&'static str, &'static [&'static str], &'static [&'static str]),
    /// A surface of `DATA`: the lift of its organ.
    Lift(&'static str),
    /// A surface of `DATA`: how long its meshes take.
    Meshes(&'static str),
}

use Source::{Bench, Lift, Meshes, Render, Study, Task};

/// A recording and what is rendered beside it.
const BESIDE: &[&str] = &["the real", "the rendered"];

const VIEW: &str = "render EPISODE --camera endoscope --size 640x360";

/// The pictures that the program makes. Those of the live view come from `viewer/test/pictures.ts`.
/// Those of recordings that are not beside the project (ball, mug) are older.
const PICTURES: &[Picture] = &[
    picture("lift.webp", Render("cell-a --camera endoscope --size 384x216")),
    picture("cell-endoscope.jpg", Render("cell-a --camera endoscope --at 4.6 --size 960x540")),
    picture("endoscope-path.jpg", Render("cell-a --camera endoscope --at 4.6 --size 960x540 --path --samples 56")),
    picture("outside.jpg", Render("cell-a --camera outside --at 3.2 --size 960x540 --path --samples 160")),
    picture("stage-start.jpg", Render("cell-a --camera endoscope --at 0 --size 640x360")),
    picture("stage-reached.jpg", Render("cell-a --camera endoscope --at 2.6 --size 640x360")),
    picture("stage-closed.jpg", Render("cell-a --camera endoscope --at 3.2 --size 640x360")),
    picture("stage-lifted.jpg", Render("cell-a --camera endoscope --at 4.6 --size 640x360")),
    picture("d405.png", Render("cell-a --camera d405 --depth --labels --size 640x360")),
    picture("cut-away.jpg", Render("PHANTOM-A --camera outside --cut-away --size 832x468")),
    picture("endoscope.png", Bench("--samples 160")),
    picture("task-retraction.jpg", Task("cell-a-retraction", VIEW)),
    picture("task-stretch.jpg", Task("cell-a-stretch", VIEW)),
    picture("task-bowel.jpg", Task("cell-a-bowel", VIEW)),
    picture("task-cell-b.jpg", Task("cell-b", VIEW)),
    picture("task-cell-c.jpg", Task("cell-c --variation standard", VIEW)),
    picture(
        "task-gallbladder-0.jpg",
        Task("cell-d-retraction", "render EPISODE --camera endoscope --at 0 --size 480x300"),
    ),
    picture("task-gallbladder-1.jpg", Task("cell-d-retraction", "render EPISODE --camera endoscope --size 480x300")),
    picture("mesh-convergence.svg", Study("mesh-convergence", &[], &["Sag", "Pull"])),
    picture("lifts.svg", Study("lifts", &[], &["Half-drop", "Normalised"])),
    picture("phantoms.svg", Study("reconstruction", &[], &["input frame", "reconstructed surfaces"])),
    picture("similarity.svg", Study("similarity", &["phantom-a", "Oblique view: phantom-a"], BESIDE)),
    picture(
        "similarity-load.svg",
        Study("similarity", &["Phantom-a, lift 2, under", "Phantom-a, lift 3, under"], BESIDE),
    ),
    picture("meshing.svg", Meshes("openhelp/Liver.stl")),
    picture("liver.svg", Lift("openhelp/Liver.stl")),
    picture("stomach.svg", Lift("openhelp/Stomach.stl")),
    picture("spleen.svg", Lift("openhelp/Spleen.stl")),
    picture("kidney-left.svg", Lift("openhelp/Kidney_left.stl")),
    picture("duodenum.svg", Lift("openhelp/Duodenum.stl")),
    picture("bladder-half.svg", Lift("openhelp/Bladder_half.stl")),
    picture("lapgym-gallbladder-visual.svg", Lift("lapgym_organs/grasp_lift_touch__gallbladder_visual.stl")),
    picture("lapgym-gallbladder-collision.svg", Lift("lapgym_organs/grasp_lift_touch__gallbladder_collision.stl")),
    picture("lapgym-liver-visual.svg", Lift("lapgym_organs/grasp_lift_touch__liver_visual.stl")),
    picture("lapgym-liver-collision.svg", Lift("lapgym_organs/grasp_lift_touch__liver_collision.stl")),
];

const fn picture(file: &'static str, from: Source) -> Picture {
    Picture { file, from }
}

/// Makes all pictures.
pub fn all(trocar: &Trocar) -> Result<(), String> {
    PICTURES.iter().try_for_each(|picture| picture.make(trocar))
}

/// Makes the picture of this file.
pub fn one(trocar: &Trocar, file: &str) -> Result<(), String> {
    let known = PICTURES.iter().find(|picture| picture.file == file);
    known.ok_or_else(|| format!("no picture '{file}' is made by a command"))?.make(trocar)
}

impl Picture {
    fn make(&self, trocar: &Trocar) -> Result<(), String> {
        let file = format!("{FOLDER}/{}", self.file);
        match self.from {
            Render(words) => {
                let words = format!("render {}", words.replace(PHANTOM_A, &format!("{PHANTOMS}/phantom-a-1/specimen")));
                if words.contains(PHANTOMS) {
                    run(trocar, &format!("specimens phantom-a --count 1 --phantoms {PHANTOMS}"))?;
                }
                run(trocar, &format!("{words} --output {file}"))
            }
            Bench(words) => run(trocar, &format!("bench render {words} --picture {file}")),
            Task(scene, words) => {
                let episode = anew(&format!("{}-episode", self.file))?;
                run(trocar, &format!("episode {scene} --policy scripted --output {episode}"))?;
                run(trocar, &format!("{} --output {file}", words.replace(EPISODE, &episode)))
            }
            Study(name, titles, figures) => {
                let page = format!("{WORK}/{name}/report.html");
                let text =
                    read(Path::new(&page)).map_err(|e| format!("{e}; run `cargo xtask figures {name}` first"))?;
                write(Path::new(&file), &sheet(&sections(&text, titles), figures, 2)?)
            }
            Lift(surface) => {
                let Some(surface) = real(surface, &file) else { return Ok(()) };
                let (specimen, lift) =
                    (anew(&format!("{}-specimen", self.file))?, anew(&format!("{}-lift", self.file))?);
                run(trocar, &format!("reconstruct --surface {surface} --units mm --output {specimen}"))?;
                run(trocar, &format!("simulate {specimen} --design live-pose --output {lift}"))?;
                write(Path::new(&file), &sheet(&read(&Path::new(&lift).join("report.html"))?, &["Lifted"], 1)?)
            }
            Meshes(surface) => {
                let Some(surface) = real(surface, &file) else { return Ok(()) };
                let folder = anew(&format!("{}-meshes", self.file))?;
                run(trocar, &format!("bench meshing {surface} --output {folder}"))?;
                write(Path::new(&file), &sheet(&read(&Path::new(&folder).join("report.html"))?, &["Time"], 2)?)
            }
        }
    }
}

/// The path of a surface of `DATA`. None if it is not beside the project: then `file` is skipped.
fn real(surface: &str, file: &str) -> Option<String> {
    let surface = format!("{DATA}/{surface}");
    let there = Path::new(&surface).is_file();
    if !there {
        eprintln!("== {file}\n   skipped: there is no {surface}");
    }
    there.then_some(surface)
}

/// The sections of a page whose titles begin with one of `titles`; all if there are none.
fn sections(page: &str, titles: &[&str]) -> String {
    let chosen = |section: &&str| titles.is_empty() || titles.iter().any(|title| section.starts_with(title));
    page.split("<h2>").filter(chosen).collect()
}

/// Runs the words of a command.
fn run(trocar: &Trocar, words: &str) -> Result<(), String> {
    trocar.run(&words.split(' ').collect::<Vec<_>>())
}

/// The path of a folder that is not there, or not any more: what an earlier program wrote is not
/// used again.
fn anew(name: &str) -> Result<String, String> {
    let folder = format!("{WORK}/{name}");
    match std::fs::remove_dir_all(&folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(format!("{folder}: {e}")),
        _ => Ok(folder),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pictures that no command of `PICTURES` makes: see there.
    const OTHERS: [&str; 7] = [
        "cup-data.jpg",
        "d405-depth-shown.png",
        "d405-labels.png",
        "k4a-mug.jpg",
        "lift-beside.webp",
        "learning-pictures.png",
        "learning.png",
    ];

    #[test]
    fn every_picture_of_the_docs_has_a_maker() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(FOLDER);
        let there = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
        let there: Vec<String> = there.filter(|file| !file.starts_with("live-view-")).collect();
        let made = |file: &str| PICTURES.iter().any(|p| p.file == file) || OTHERS.contains(&file);
        let unknown: Vec<&String> = there.iter().filter(|file| !made(file)).collect();
        assert!(unknown.is_empty(), "no command makes {unknown:?}");
        let missing: Vec<&str> = PICTURES.iter().map(|p| p.file).filter(|f| !there.iter().any(|t| t == f)).collect();
        assert!(missing.is_empty(), "not in {FOLDER}: {missing:?}");
    }
}
