//! Mesher that runs the separate program TetGen, which produced the paper's meshes.
//!
//! H. Si, "TetGen, a Delaunay-based quality tetrahedral mesh generator", ACM Transactions on
//! Mathematical Software 41(2), 2015. TetGen is licensed under the AGPL. It runs only as a separate
//! process, on files.

mod files;

use super::body::largest_body;
use super::interface::Mesher;
use crate::distance::check;
use crate::{Error, Result, TetMesh, TriMesh};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Interval at which the running program is polled.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum program output that is read after a failure (bytes).
const MAX_OUTPUT_BYTES: u64 = 64 * 1024;
/// Maximum length of a quoted output line (characters).
const MAX_MESSAGE_CHARS: usize = 160;
/// Largest relative difference between the volume of the elements and of the surface, which have
/// the same triangles.
const VOLUME_TOLERANCE: f64 = 1e-3;
/// Name of the input file. TetGen derives its output names from it.
const INPUT: &str = "body.smesh";

/// Meshes a surface with TetGen, if it is installed. The nodes of the surface are kept, and TetGen
/// may add nodes on it.
///
/// The defaults are the settings of the paper and of TetGen 1.5: radius-edge ratio 1.6, smallest
/// dihedral angle 10 degrees. TetGen does not reach both everywhere (1.5 degrees in a real kidney).
/// It may not terminate for much stricter settings.
#[derive(Clone, Debug, PartialEq)]
pub struct TetgenMesher {
    /// The program: a name to search in `PATH`, or a path.
    pub program: PathBuf,
    /// Largest ratio of an element's circumradius to its shortest edge.
    pub radius_edge: f64,
    /// Target for the smallest dihedral angle (degrees).
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
    /// Runs the program in a temporary folder. Elements with negative volume are flipped. If there
    /// are several parts, the largest is kept.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh> {
        check(surface)?;
        if !surface.is_watertight() {
            let open = surface.open_edges();
            return Err(self.error(&format!("needs a closed surface; this one has {open} open edges")));
        }
        let switches = self.switches()?;
        let folder = tempfile::Builder::new()
            .prefix("trocar-tetgen-")
            .tempdir()
            .map_err(|e| self.error(&format!("could not create a temporary folder: {e}")))?;
        let folder = folder.path();
        // Unused vertices are removed; they would become nodes.
        files::write_smesh(&folder.join(INPUT), &surface.submesh(|_| true))?;

        let deadline = Instant::now() + self.time_limit;
        let status = self.run(&switches, folder, deadline)?;
        let (nodes, elements) = (folder.join("body.1.node"), folder.join("body.1.ele"));
        if !(status.success() && nodes.exists() && elements.exists()) {
            return Err(self.failure(status, folder, deadline));
        }
        let (first, vertices) = files::read_nodes(&nodes)?;
        let tets = files::read_elements(&elements, first, vertices.len())?;
        self.checked(TetMesh { vertices, tets }, surface)
    }

    fn describe(&self) -> String {
        let (ratio, angle) = (self.radius_edge, self.min_dihedral_deg);
        format!("TetGen -q{ratio}/{angle}")
    }
}

impl TetgenMesher {
    /// Switches: p keeps the surface, q sets the quality, Q is quiet, F writes no face and edge
    /// files.
    fn switches(&self) -> Result<String> {
        let (ratio, angle) = (self.radius_edge, self.min_dihedral_deg);
        // Below a ratio of about 1 TetGen does not terminate.
        if !((1.0..=100.0).contains(&ratio) && (0.0..=60.0).contains(&angle)) {
            return Err(self.error(&format!(
                "needs a radius-edge ratio in [1, 100] and a dihedral angle in [0, 60] degrees, not {ratio} and {angle}"
            )));
        }
        Ok(format!("-pq{ratio}/{angle}QF"))
    }

    /// Runs the program on the input in `folder`. Its output goes to files there.
    fn run(&self, switches: &str, folder: &Path, deadline: Instant) -> Result<ExitStatus> {
        let io = |e: std::io::Error| self.error(&format!("could not be run: {e}"));
        // A relative path refers to the current folder, not to the folder the program runs in.
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
                std::io::ErrorKind::NotFound => self.error(
                    "is not installed (Debian, Ubuntu: apt install tetgen); the lattice mesher needs no external program",
                ),
                _ => io(e),
            })?;
        loop {
            if let Some(status) = child.try_wait().map_err(io)? {
                return Ok(status);
            }
            if Instant::now() >= deadline {
                // Both fail only if the program has just ended.
                let _ = child.kill();
                let _ = child.wait();
                return Err(self.error(&format!(
                    "was stopped after {:.0} s; use a surface with fewer triangles, a higher time limit or the lattice mesher",
                    self.time_limit.as_secs_f64()
                )));
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// The cause of a failure from the program's output, or from its own check of the surface if
    /// there is none.
    fn failure(&self, status: ExitStatus, folder: &Path, deadline: Instant) -> Error {
        let mut said = failure_message(folder);
        // TetGen's output is lost when it aborts. `-d` reports intersecting triangles.
        if !status.success() && self.run("-dNEF", folder, deadline).is_ok() {
            said =
                failure_message(folder).filter(|text| text.contains("intersect") && !text.starts_with("No ")).or(said);
        }
        match said {
            Some(text) if text.contains("intersect") => self.error(&format!(
                "rejects a surface that intersects itself ({text}); repair it, or use the lattice mesher"
            )),
            Some(text) => self.error(&format!("failed ({status}): {text}")),
            None => self.error(&format!("failed ({status}) without a message; try the lattice mesher")),
        }
    }

    /// Checks the elements and returns one body of positive elements that fills the surface.
    fn checked(&self, mut mesh: TetMesh, surface: &TriMesh) -> Result<TetMesh> {
        for t in 0..mesh.tets.len() {
            if mesh.tet_volume(t) < 0.0 {
                mesh.tets[t].swap(2, 3);
            }
        }
        let flat = mesh.inverted();
        if flat > 0 {
            return Err(self.error(&format!("returned {flat} of {} elements without volume", mesh.tets.len())));
        }
        if mesh.tets.is_empty() {
            return Err(self.error("returned no elements"));
        }
        let (filled, enclosed) = (mesh.volume(), surface.volume());
        let off = ((filled - enclosed) / enclosed).abs();
        if off.is_nan() || off > VOLUME_TOLERANCE {
            return Err(self.error(&format!(
                "filled {:.3} cm3 of a surface that encloses {:.3} cm3; the surface must be a single outward one without cavities",
                1e6 * filled,
                1e6 * enclosed
            )));
        }
        Ok(largest_body(mesh))
    }

    fn error(&self, what: &str) -> Error {
        Error::Mesh(format!("TetGen ({}) {what}", self.program.display()))
    }
}

/// The output line that best describes a failure.
fn failure_message(folder: &Path) -> Option<String> {
    let text = ["out.txt", "err.txt"].map(|name| tail(&folder.join(name)).unwrap_or_default()).join("\n");
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    let marked = |mark: &str| lines().find(|line| line.to_lowercase().contains(mark));
    let line =
        ["!!", "intersect", "error", "fail", "stop"].iter().find_map(|mark| marked(mark)).or(lines().next_back())?;
    Some(line.trim_start_matches(['!', ' ']).chars().filter(|c| !c.is_control()).take(MAX_MESSAGE_CHARS).collect())
}

/// The last [`MAX_OUTPUT_BYTES`] of a text file.
fn tail(path: &Path) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(MAX_OUTPUT_BYTES)))?;
    let mut bytes = Vec::new();
    file.take(MAX_OUTPUT_BYTES).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
