//! What meshing costs: the lattice mesher from ten thousand to a million elements, and side by side with TetGen and fTetWild.

use super::pytetwild::PytetwildMesher;
use crate::{Error, Result, pages};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{LatticeMesher, Mesher, TetMesh, TetQuality, TetgenMesher, TriMesh, repair};
use trocar_specimen::StagedFolder;
use trocar_testing::scenes::ellipsoid;
use trocar_workflow::REPORT;

/// The file that makes a folder one of this benchmark's.
const MARKER: &str = "meshing.json";
/// Half axes of the body that is meshed where no surface is named [m]: 815 cm3, the paper's liver.
const LIVER: [f64; 3] = [0.105, 0.064, 0.029];

/// The benchmark's options.
#[derive(Clone, Debug)]
pub struct MeshingBench {
    /// Surfaces; an ellipsoid of a liver's size where there is none.
    pub surfaces: Vec<PathBuf>,
    /// Their unit.
    pub unit: Unit,
    /// Numbers of elements the lattice mesher is asked for.
    pub sizes: Vec<usize>,
    /// Python that has `pytetwild`.
    pub python: PathBuf,
}

/// One mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshingRow {
    /// The surface's name.
    pub surface: String,
    /// `size` for the series over element counts, `peers` for the comparison.
    pub series: &'static str,
    /// The mesher and its settings.
    pub mesher: String,
    /// Why there is no mesh; the figures are then 0.
    pub failure: Option<String>,
    /// Nodes.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Wall time from surface to mesh [s], the least of the runs.
    pub seconds: f64,
    /// The same per element [ns].
    pub ns_per_tet: f64,
    /// Smallest dihedral angle [degrees].
    pub min_dihedral_deg: f64,
    /// Median over elements of the smallest dihedral angle [degrees].
    pub median_dihedral_deg: f64,
    /// Largest dihedral angle [degrees].
    pub max_dihedral_deg: f64,
    /// Elements with volume at or below 0.
    pub inverted: usize,
    /// Median edge [mm].
    pub median_edge_mm: f64,
    /// Volume over that of the surface, minus 1.
    pub volume_error: f64,
}

/// The benchmark's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct MeshingResult {
    /// Every mesh.
    pub rows: Vec<MeshingRow>,
    /// Time per element at the largest size over that at the smallest: 1 when the cost is linear.
    pub linearity: Option<f64>,
    /// Worker threads.
    pub threads: usize,
    /// The report's path.
    pub report: String,
}

impl MeshingBench {
    /// Runs everything and writes the report into the folder `output`.
    ///
    /// # Errors
    /// A surface that cannot be read, a folder that cannot be written, an interruption. A mesher that fails is a row that says why.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<MeshingResult> {
        let staged = StagedFolder::create(output, MARKER)?;
        let surfaces = self.surfaces()?;
        progress.begin("meshes", (self.sizes.len() + 3 * surfaces.len()) as u64);
        let mut rows = Vec::new();
        let mut measure = |name: &str, series: &'static str, surface: &TriMesh, mesher: &dyn Mesher, runs: usize| {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            rows.push(row(name, series, surface, mesher, runs));
            progress.advance(1);
            Ok(())
        };
        let (name, first) = &surfaces[0];
        for &size in &self.sizes {
            let mesher = LatticeMesher::for_body(first, 0.0, size);
            measure(name, "size", first, &mesher, if size <= 200_000 { 3 } else { 1 })?;
        }
        for (name, surface) in &surfaces {
            let lattice = LatticeMesher::for_body(surface, 2.2e-3, 50_000);
            measure(name, "peers", surface, &lattice, 3)?;
            measure(name, "peers", surface, &TetgenMesher::default(), 1)?;
            measure(name, "peers", surface, &PytetwildMesher { python: self.python.clone() }, 1)?;
        }
        progress.end();
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let per_tet = |r: Option<&MeshingRow>| r.filter(|r| r.tets > 0).map(|r| r.ns_per_tet);
        let mut of_size: Vec<&MeshingRow> = rows.iter().filter(|r| r.series == "size").collect();
        of_size.sort_by_key(|r| r.tets);
        let linearity = per_tet(of_size.last().copied()).zip(per_tet(of_size.first().copied())).map(|(a, b)| a / b);
        let result = MeshingResult {
            linearity,
            threads: rayon::current_num_threads(),
            report: output.join(REPORT).display().to_string(),
            rows,
        };
        let html = pages::meshing(&result)?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        for (name, bytes) in [(REPORT, html.into_bytes()), (MARKER, json)] {
            let path = staged.path().join(name);
            std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })?;
        }
        staged.commit()?;
        Ok(result)
    }

    /// The surfaces by name, repaired if need be.
    fn surfaces(&self) -> Result<Vec<(String, TriMesh)>> {
        if self.surfaces.is_empty() {
            return Ok(vec![("ellipsoid of 815 cm3".into(), ellipsoid(LIVER.into(), 3e-3))]);
        }
        let read = |path: &PathBuf| -> Result<(String, TriMesh)> {
            let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let raw = read_surface(path, self.unit)?;
            Ok((name, repair(&raw)?.0))
        };
        self.surfaces.iter().map(read).collect()
    }
}

fn row(name: &str, series: &'static str, surface: &TriMesh, mesher: &dyn Mesher, runs: usize) -> MeshingRow {
    let mut seconds = f64::INFINITY;
    let mut made: std::result::Result<TetMesh, trocar_geometry::Error> = Ok(TetMesh::default());
    for _ in 0..runs {
        let clock = Instant::now();
        made = mesher.mesh(surface);
        seconds = seconds.min(clock.elapsed().as_secs_f64());
        if made.is_err() {
            break;
        }
    }
    let (mesh, failure) = match made {
        Ok(mesh) => (mesh, None),
        Err(e) => (TetMesh::default(), Some(e.to_string())),
    };
    let quality = TetQuality::of(&mesh);
    let tets = mesh.tets.len();
    MeshingRow {
        surface: name.to_owned(),
        series,
        mesher: mesher.describe(),
        nodes: mesh.vertices.len(),
        tets,
        seconds: if failure.is_none() { seconds } else { 0.0 },
        ns_per_tet: if tets > 0 { 1e9 * seconds / tets as f64 } else { 0.0 },
        min_dihedral_deg: quality.min_dihedral_deg,
        median_dihedral_deg: quality.median_min_dihedral_deg,
        max_dihedral_deg: quality.max_dihedral_deg,
        inverted: quality.inverted,
        median_edge_mm: 1e3 * quality.median_edge,
        volume_error: if tets > 0 { quality.volume / surface.volume() - 1.0 } else { 0.0 },
        failure,
    }
}
