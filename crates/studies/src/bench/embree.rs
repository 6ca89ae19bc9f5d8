//! Embree through the Python package `embreex`, for comparison: a separate process on one thread.

use glam::Vec3;
use std::path::Path;
use std::process::Command;
use trocar_geometry::TriMesh;

/// Reads float32 vertices, int32 triangles, float32 origins and directions. Prints the least time
/// (s) and writes float32 distances, in units of the directions.
const SCRIPT: &str = "
import sys, time, numpy
from embreex.rtcore_scene import EmbreeScene
from embreex.mesh_construction import TriangleMesh
folder, tries = sys.argv[1], int(sys.argv[2])
read = lambda name, kind: numpy.fromfile(folder + '/' + name, dtype=kind).reshape(-1, 3)
scene = EmbreeScene()
mesh = TriangleMesh(scene, read('vertices', numpy.float32), read('triangles', numpy.int32))
origins, directions = read('origins', numpy.float32), read('directions', numpy.float32)
scene.run(origins[:10], directions[:10], query='DISTANCE')
least = float('inf')
for _ in range(tries):
    clock = time.perf_counter()
    distances = scene.run(origins, directions, query='DISTANCE')
    least = min(least, time.perf_counter() - clock)
numpy.asarray(distances, dtype=numpy.float32).tofile(folder + '/distances')
print(least)
";

/// Embree reports a larger distance if nothing is hit.
const NOTHING: f32 = 1e30;

/// Embree in a Python environment.
pub(super) struct Embree<'a> {
    /// Python with the package.
    pub python: &'a Path,
    /// Repetitions; the fastest counts.
    pub tries: usize,
}

/// Embree's result.
pub(super) struct EmbreeRows {
    /// Least time (s).
    pub seconds: f64,
    /// Distances in units of the directions; infinite for a miss.
    pub distances: Vec<f32>,
}

impl Embree<'_> {
    /// First hits of rays given by origin and direction. The error is one line.
    pub fn cast(&self, mesh: &TriMesh, rays: &[(Vec3, Vec3)]) -> Result<EmbreeRows, String> {
        let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
        let write = |name: &str, bytes: Vec<u8>| {
            std::fs::write(folder.path().join(name), bytes).map_err(|e| format!("the temporary folder: {e}"))
        };
        let bytes =
            |of: &mut dyn Iterator<Item = Vec3>| of.flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
        write("vertices", bytes(&mut mesh.vertices.iter().map(|v| v.as_vec3())))?;
        write("triangles", mesh.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect())?;
        write("origins", bytes(&mut rays.iter().map(|r| r.0)))?;
        write("directions", bytes(&mut rays.iter().map(|r| r.1)))?;
        let tries = self.tries.to_string();
        let run = Command::new(self.python).args(["-c", SCRIPT]).arg(folder.path()).arg(tries).output();
        let output = run.map_err(|e| format!("{} cannot be started: {e}", self.python.display()))?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().last().unwrap_or("no message");
            let hint = if last.contains("No module") { "; needed: pip install embreex" } else { "" };
            return Err(format!("{last}{hint}"));
        }
        let said = String::from_utf8_lossy(&output.stdout);
        let seconds = said.trim().parse().map_err(|_| format!("Embree printed no time but '{}'", said.trim()))?;
        let file = std::fs::read(folder.path().join("distances")).map_err(|e| format!("Embree's distances: {e}"))?;
        let far = |d: f32| if d < NOTHING { d } else { f32::INFINITY };
        let distances: Vec<f32> = file.as_chunks().0.iter().map(|b| far(f32::from_le_bytes(*b))).collect();
        if distances.len() != rays.len() {
            return Err(format!("Embree returned {} distances for {} rays", distances.len(), rays.len()));
        }
        Ok(EmbreeRows { seconds, distances })
    }
}
