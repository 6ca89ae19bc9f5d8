//! TetGen as a mesher: the separate program of that name, which the paper's meshes were made with.
//!
//! Hang Si, "TetGen, a Delaunay-based quality tetrahedral mesh generator", ACM Transactions on Mathematical Software 41(2),
//! 2015. The program is under the AGPL. It is only ever run as a process of its own, on files.

mod files;

use super::Mesher;
use super::body::largest_body;
use crate::distance::check;
use crate::{Error, Result, TetMesh, TriMesh};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How often the running program is looked at.
const GLANCE: Duration = Duration::from_millis(5);
/// Most of the program's text that is read when it fails [bytes].
const MOST_TEXT: u64 = 64 * 1024;
/// Most of a line of its text that is repeated [characters].
const MOST_WORDS: usize = 160;
/// Part by which the elements' volume may differ from the surface's. Both follow the same triangles.
const VOLUME_TOLERANCE: f64 = 1e-3;
/// The surface's file, and the stem of the program's.
const INPUT: &str = "body.smesh";

/// Fills a surface with TetGen, if it is installed. The nodes of the surface are kept and others may be added on it.
///
/// The defaults are the paper's settings, and those of TetGen 1.5: radius-edge ratio 1.6, smallest dihedral angle 10
/// degrees. TetGen aims at both and reaches neither everywhere (1.5 degrees in a real kidney); much stricter ones may keep
/// it busy for ever.
#[derive(Clone, Debug, PartialEq)]
pub struct TetgenMesher {
    /// The program: a name to be looked for in `PATH`, or a path.
    pub program: PathBuf,
    /// Largest ratio of an element's circumradius to its shortest edge.
    pub radius_edge: f64,
    /// Smallest dihedral angle to aim at [degrees].
    pub min_dihedral_deg: f64,
    /// Time after which the program is stopped.
    pub time_limit: Duration,
}

impl Default for TetgenMesher {
    fn default() -> Self {
        Self {
            program: "tetgen".into(),
            radius_edge: 1.6,
            min_dihedral_deg: 10.0,
            time_limit: Duration::from_secs(120),
        }
    }
}

impl Mesher for TetgenMesher {
    /// Runs the program in a private folder that is gone afterwards. Elements it gives with negative volume are turned;
    /// of several parts the largest stays.
    ///
    /// # Errors
    /// When the surface is not closed or crosses itself, the program is missing, fails, takes too long or writes files
    /// that make no sense, and when its elements do not fill the surface.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh> {
        check(surface)?;
        if !surface.is_watertight() {
            let open = surface.open_edges();
            return Err(self.wrong(&format!("needs a closed surface; this one has {open} open edges")));
        }
        let switches = self.switches()?;
        let folder = tempfile::Builder::new()
            .prefix("trocar-tetgen-")
            .tempdir()
            .map_err(|e| self.wrong(&format!("needs a folder for temporary files, and none can be made: {e}")))?;
        let folder = folder.path();
        // Without vertices that no triangle uses: they would become nodes.
        files::write_smesh(&folder.join(INPUT), &surface.submesh(|_| true))?;

        let deadline = Instant::now() + self.time_limit;
        let status = self.run(&switches, folder, deadline)?;
        let (nodes, elements) = (folder.join("body.1.node"), folder.join("body.1.ele"));
        if !(status.success() && nodes.exists() && elements.exists()) {
            return Err(self.explain(status, folder, deadline));
        }
        let (first, vertices) = files::read_nodes(&nodes)?;
        let tets = files::read_elements(&elements, first, vertices.len())?;
        self.sound(TetMesh { vertices, tets }, surface)
    }

    fn describe(&self) -> String {
        let (ratio, angle) = (self.radius_edge, self.min_dihedral_deg);
        format!("TetGen -q{ratio}/{angle}")
    }
}

impl TetgenMesher {
    /// p: the surface stays; q: quality; Q: quiet; F: no files of faces and edges.
    fn switches(&self) -> Result<String> {
        let (ratio, angle) = (self.radius_edge, self.min_dihedral_deg);
        // Below about 1 TetGen does not come to an end.
        if !((1.0..=100.0).contains(&ratio) && (0.0..=60.0).contains(&angle)) {
            return Err(self.wrong(&format!(
                "takes a radius-edge ratio of 1 to 100 and dihedral angles of 0 to 60 degrees, not {ratio} and {angle}"
            )));
        }
        Ok(format!("-pq{ratio}/{angle}QF"))
    }

    /// Runs the program on the input in `folder`; its text goes to files there.
    fn run(&self, switches: &str, folder: &Path, deadline: Instant) -> Result<ExitStatus> {
        let io = |e: std::io::Error| self.wrong(&format!("could not be run: {e}"));
        // A path is taken from here, not from the folder the program runs in.
        let is_path = self.program.components().count() > 1;
        let program = if is_path { std::path::absolute(&self.program).map_err(io)? } else { self.program.clone() };
        let mut child = Command::new(program)
            .args([switches, INPUT])
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(File::create(folder.join("out.txt")).map_err(io)?)
            .stderr(File::create(folder.join("err.txt")).map_err(io)?)
            .spawn()
            .map_err(|e| match e.kind() {
                std::io::ErrorKind::NotFound => self.wrong(
                    "is not installed (Debian, Ubuntu: apt install tetgen); the lattice mesher needs no other program",
                ),
                _ => io(e),
            })?;
        loop {
            if let Some(status) = child.try_wait().map_err(io)? {
                return Ok(status);
            }
            if Instant::now() >= deadline {
                // Both fail only when it has just ended by itself.
                let _ = child.kill();
                let _ = child.wait();
                return Err(self.wrong(&format!(
                    "was stopped after {:.0} s; a surface of fewer triangles, a higher time limit or the lattice mesher helps",
                    self.time_limit.as_secs_f64()
                )));
            }
            std::thread::sleep(GLANCE);
        }
    }

    /// What went wrong, from what the program says; where it died without a word, from its own check of the surface.
    fn explain(&self, status: ExitStatus, folder: &Path, deadline: Instant) -> Error {
        let mut said = complaint(folder);
        // TetGen's last words are lost when it aborts: ask it for the triangles that cross.
        if !status.success() && self.run("-dNEF", folder, deadline).is_ok() {
            said = complaint(folder).filter(|text| text.contains("intersect") && !text.starts_with("No ")).or(said);
        }
        match said {
            Some(text) if text.contains("intersect") => self.wrong(&format!(
                "refuses a surface that crosses itself ({text}); repair it, or use the lattice mesher"
            )),
            Some(text) => self.wrong(&format!("failed ({status}): {text}")),
            None => self.wrong(&format!("failed ({status}) without a word; the lattice mesher may do better")),
        }
    }

    /// Positive elements in one body that fills the surface.
    fn sound(&self, mut mesh: TetMesh, surface: &TriMesh) -> Result<TetMesh> {
        for t in 0..mesh.tets.len() {
            if mesh.tet_volume(t) < 0.0 {
                mesh.tets[t].swap(2, 3);
            }
        }
        let flat = mesh.inverted();
        if flat > 0 {
            return Err(self.wrong(&format!("gave {flat} of {} elements without volume", mesh.tets.len())));
        }
        if mesh.tets.is_empty() {
            return Err(self.wrong("gave no elements"));
        }
        let (filled, enclosed) = (mesh.volume(), surface.volume());
        let off = ((filled - enclosed) / enclosed).abs();
        if off.is_nan() || off > VOLUME_TOLERANCE {
            return Err(self.wrong(&format!(
                "filled {:.3} cm3 of a surface that encloses {:.3} cm3; is it a single outward surface without hollows?",
                1e6 * filled,
                1e6 * enclosed
            )));
        }
        Ok(largest_body(mesh))
    }

    fn wrong(&self, what: &str) -> Error {
        Error::Mesh(format!("TetGen ({}) {what}", self.program.display()))
    }
}

/// The line of the program's text that says most about a failure.
fn complaint(folder: &Path) -> Option<String> {
    let text = ["out.txt", "err.txt"].map(|name| tail(&folder.join(name)).unwrap_or_default()).join("\n");
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    let marked = |mark: &str| lines().find(|line| line.to_lowercase().contains(mark));
    let line =
        ["!!", "intersect", "error", "fail", "stop"].iter().find_map(|mark| marked(mark)).or(lines().next_back())?;
    Some(line.trim_start_matches(['!', ' ']).chars().filter(|c| !c.is_control()).take(MOST_WORDS).collect())
}

/// The end of a text file.
fn tail(path: &Path) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(MOST_TEXT)))?;
    let mut bytes = Vec::new();
    file.take(MOST_TEXT).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
