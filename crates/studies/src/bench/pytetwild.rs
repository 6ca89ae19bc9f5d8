//! fTetWild through the Python package `pytetwild`, for comparison: a separate process.

use std::path::{Path, PathBuf};
use std::process::Command;
use trocar_geometry::{Error, Mesher, Result, TetMesh, TriMesh};

/// Reads float64 vertices and int32 triangles; writes float64 vertices and int32 tets.
const SCRIPT: &str = "
import sys, numpy, pytetwild
folder = sys.argv[1]
vertices = numpy.fromfile(folder + '/vertices').reshape(-1, 3)
triangles = numpy.fromfile(folder + '/triangles', dtype=numpy.int32).reshape(-1, 3)
vertices, tets = pytetwild.tetrahedralize(vertices, triangles)[:2]
numpy.asarray(vertices, dtype=numpy.float64).tofile(folder + '/nodes')
numpy.asarray(tets, dtype=numpy.int32).tofile(folder + '/tets')
";

/// fTetWild with its default settings.
pub(super) struct PytetwildMesher {
    /// Python with the package.
    pub(super) python: PathBuf,
}

impl Mesher for PytetwildMesher {
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh> {
        let wrong = |reason: String| Error::Mesh(reason);
        let folder = tempfile::tempdir().map_err(|e| wrong(format!("no temporary folder: {e}")))?;
        let file = |name: &str| folder.path().join(name);
        let vertices = surface.vertices.iter().flat_map(|v| v.to_array()).flat_map(f64::to_le_bytes).collect();
        let triangles = surface.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        write(&file("vertices"), vertices)?;
        write(&file("triangles"), triangles)?;
        // A relative path is relative to the user's folder; a bare name is searched in PATH.
        let python = match self.python.components().count() {
            1 => self.python.clone(),
            _ => std::path::absolute(&self.python).unwrap_or_else(|_| self.python.clone()),
        };
        let run = Command::new(&python).args(["-c", SCRIPT]).arg(folder.path()).current_dir(folder.path()).output();
        let output = run.map_err(|e| wrong(format!("{} cannot be started: {e}", self.python.display())))?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().last().unwrap_or("no message");
            let hint = if last.contains("No module") { "; needed: pip install pytetwild pyvista" } else { "" };
            return Err(wrong(format!("{last}{hint}")));
        }
        let read = |name: &str| {
            let path = file(name);
            std::fs::read(&path).map_err(|source| Error::Io { path, source })
        };
        let nodes = read("nodes")?;
        let mut numbers = nodes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b));
        let mut mesh = TetMesh::default();
        while let (Some(x), Some(y), Some(z)) = (numbers.next(), numbers.next(), numbers.next()) {
            mesh.vertices.push(glam::DVec3::new(x, y, z));
        }
        let tets = read("tets")?;
        let indices: Vec<u32> = tets.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        if indices.iter().any(|v| *v as usize >= mesh.vertices.len()) {
            return Err(wrong("pytetwild returned an element with a missing node".into()));
        }
        mesh.tets = indices.as_chunks().0.to_vec();
        // fTetWild orders the nodes of an element the other way round.
        for t in 0..mesh.tets.len() {
            if mesh.tet_volume(t) < 0.0 {
                mesh.tets[t].swap(2, 3);
            }
        }
        Ok(mesh)
    }

    fn describe(&self) -> String {
        "fTetWild (pytetwild)".into()
    }
}

fn write(path: &Path, bytes: Vec<u8>) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.to_owned(), source })
}
