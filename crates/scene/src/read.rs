//! Reading scenes: files and built-in ones, checked whole.

use crate::check::{Problem, check};
use crate::scene::Origin;
use crate::{Builtin, Error, Phantom, Result, Scene, Source, SpecimenSource};
use std::io::{ErrorKind, Read};
use std::path::Path;
use trocar_specimen::{Specimen, line_of, nearest, parse_toml};

/// Largest scene file (bytes); the paper's has about 8,000.
const MAX_BYTES: u64 = 1 << 20;

/// What is right in the place of a path that is no scene file.
const EXPECTED: &str = "a scene is a TOML file, which `trocar scene new SPECIMEN` writes, or the name of a built-in \
                        scene, which `trocar scene list` lists";

impl Scene {
    /// The scene of that path or built-in name, checked whole: what it names by path is there, and
    /// what it says of organs is said of organs that the specimen has.
    ///
    /// # Errors
    /// Names the file, the line and the field, what is wrong and what would be right; see
    /// [`Error`].
    pub fn read(path_or_name: &str) -> Result<Self> {
        if Builtin::named(path_or_name).is_some() {
            return Self::builtin(path_or_name);
        }
        let path = Path::new(path_or_name);
        if !path.exists() && !path_or_name.contains(['/', '\\', '.']) {
            return Err(unknown(path_or_name));
        }
        Self::read_file(path)
    }

    /// The scene in a file; see [`read`](Self::read).
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_file(path: &Path) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let name = path.display().to_string();
        if path.is_dir() {
            return Err(Error::Invalid { file: name, reason: format!("is {}; {EXPECTED}", folder_kind(path)) });
        }
        let mut text = String::new();
        let file = match std::fs::File::open(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => {
                return Err(Error::Invalid { file: name, reason: format!("no such file; {EXPECTED}") });
            }
            opened => opened.map_err(io)?,
        };
        file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(io)?;
        if text.len() as u64 > MAX_BYTES {
            let reason = format!("the file has more than {MAX_BYTES} bytes; a scene file has a few thousand");
            return Err(Error::Invalid { file: name, reason });
        }
        let mut scene = Self::parse(&text, &name, path.parent().unwrap_or(Path::new("")))?;
        scene.origin = Origin(Some(name));
        Ok(scene)
    }

    /// The built-in scene of that name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn builtin(name: &str) -> Result<Self> {
        let builtin = Builtin::named(name).ok_or_else(|| unknown(name))?;
        Self::parse(builtin.text, name, Path::new(""))
    }

    /// The scene in `text`, which errors call `file`; its paths start from `folder`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: &str, folder: &Path) -> Result<Self> {
        let invalid = |reason| Error::Invalid { file: file.to_owned(), reason };
        let mut scene: Self = parse_toml(text).map_err(|reason| invalid(moved(reason)))?;
        scene.folder = folder.to_owned();
        let placed = |problem: Problem| {
            let line = line_of(text, &problem.field).map_or_else(String::new, |n| format!("line {n}: "));
            invalid(format!("{line}{}{}", problem.field, problem.reason))
        };
        check(&scene).map_err(placed)?;
        scene.check_all_organs()?.map_err(placed)?;
        Ok(scene)
    }

    /// Checks a scene that was put together or changed by a program, as [`read`](Self::read) checks
    /// a file.
    ///
    /// # Errors
    /// As [`read`](Self::read), without lines.
    pub fn validate(&self) -> Result<()> {
        let invalid = |p: Problem| Error::Invalid {
            file: format!("scene '{}'", self.name),
            reason: format!("{}{}", p.field, p.reason),
        };
        check(self).map_err(invalid)?;
        self.check_all_organs()?.map_err(invalid)
    }

    /// Checks what is said of organs for every specimen that episodes may have.
    fn check_all_organs(&self) -> Result<std::result::Result<(), Problem>> {
        let drawn = self.variation.specimens.iter();
        let paths = drawn.clone().flat_map(|s| s.paths.iter().map(|p| SpecimenSource::folder(p)));
        let phantoms = drawn.flat_map(|s| s.phantoms.iter().map(|p| SpecimenSource::phantom(p, s.seeds[0])));
        for (k, source) in std::iter::once(self.specimen.clone()).chain(paths).chain(phantoms).enumerate() {
            if let Err(problem) = crate::check::check_organs(self, &self.organ_names_of(&source)?) {
                let Problem { field, reason } = problem;
                return Ok(Err(match k {
                    0 => Problem { field, reason },
                    _ => Problem {
                        field: "variation.specimens".to_owned(),
                        reason: format!(" has {}, with which {field}{reason}", source.label()),
                    },
                }));
            }
        }
        Ok(Ok(()))
    }

    /// The names of the specimen's organs.
    ///
    /// # Errors
    /// When the specimen's folder is unusable.
    pub fn organ_names(&self) -> Result<Vec<String>> {
        self.organ_names_of(&self.specimen)
    }

    fn organ_names_of(&self, source: &SpecimenSource) -> Result<Vec<String>> {
        match source.source() {
            Some(Source::Folder(path)) => Ok(Specimen::organ_names(&self.resolve(path))?),
            Some(Source::Phantom(name, _)) => {
                let organs = Phantom::named(name).map_or(&[][..], |p| p.organs);
                Ok(organs.iter().map(|&o| o.to_owned()).collect())
            }
            None => Ok(Vec::new()),
        }
    }
}

/// What the folder `path` is, by the file that each kind of folder has.
fn folder_kind(path: &Path) -> &'static str {
    const KINDS: [(&str, &str); 4] = [
        ("specimen.toml", "a specimen folder"),
        ("recording.toml", "a recording folder"),
        ("campaign.json", "a campaign folder"),
        ("episode.trocar", "an episode folder"),
    ];
    KINDS.iter().find(|(file, _)| path.join(file).is_file()).map_or("a folder", |(_, kind)| kind)
}

/// The replacement of a key of earlier scenes.
fn moved(reason: String) -> String {
    const EARLIER: &str = "task.variation: unknown field";
    match reason.find(EARLIER) {
        Some(at) => {
            let line = &reason[..at];
            format!(
                "{line}task.variation is no longer a key; write [variation] with a distribution for each factor, \
                 such as tilt_deg = {{ within = 1.0 }}"
            )
        }
        None => reason,
    }
}

fn unknown(name: &str) -> Error {
    let names = || crate::BUILTINS.iter().map(|b| b.name);
    Error::Unknown {
        name: name.to_owned(),
        known: names().collect::<Vec<_>>().join(", "),
        nearest: nearest(name, names()).map(str::to_owned),
    }
}
