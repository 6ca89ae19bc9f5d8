//! Cost of meshing: the lattice mesher from ten thousand to a million elements, and beside TetGen
//! and fTetWild.

use super::pytetwild::PytetwildMesher;
use crate::Result;
use crate::names::Units;
use crate::scenes::ellipsoid;
use crate::study::{Job, Kind, Study};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use trocar_geometry::io::read_surface;
use trocar_geometry::{LatticeMesher, Mesher, TetMesh, TetQuality, TetgenMesher, TriMesh, repair};
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};
use trocar_workflow::check_interrupted;

/// Half axes of the default body (m): an ellipsoid of 815 cm3, the volume of the paper's liver.
const LIVER: [f64; 3] = [0.105, 0.064, 0.029];

/// The lattice mesher from ten thousand to a million elements, and beside TetGen and fTetWild.
#[derive(Clone, Debug, Args)]
pub struct MeshingBench {
    /// Closed surfaces (.stl, .ply, .obj); by default an ellipsoid of the size of a liver. The
    /// first is also meshed at all sizes.
    pub surfaces: Vec<PathBuf>,
    /// Unit of the surface files.
    #[arg(long, value_enum, default_value_t = Units::Mm)]
    pub units: Units,
    /// Target numbers of elements.
    #[arg(long, value_delimiter = ',', default_values_t = [10_000, 30_000, 100_000, 300_000, 1_000_000])]
    pub sizes: Vec<usize>,
    /// Python with the package pytetwild.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
}

/// One mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshingRow {
    /// Name of the surface.
    pub surface: String,
    /// `size` for the series over sizes, `peers` for the comparison of meshers.
    pub series: &'static str,
    /// The mesher and its settings.
    pub mesher: String,
    /// Why meshing failed; then the figures are 0.
    pub failure: Option<String>,
    /// Nodes.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Wall time from surface to mesh (s), the least of the runs.
    pub seconds: f64,
    /// The same per element (ns).
    pub ns_per_tet: f64,
    /// Smallest dihedral angle (degrees).
    pub min_dihedral_deg: f64,
    /// Median over elements of the smallest dihedral angle (degrees).
    pub median_dihedral_deg: f64,
    /// Largest dihedral angle (degrees).
    pub max_dihedral_deg: f64,
    /// Number of inverted elements.
    pub inverted: usize,
    /// Median edge (mm).
    pub median_edge_mm: f64,
    /// Volume of the mesh over that of the surface, minus 1.
    pub volume_error: f64,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct MeshingResult {
    /// All meshes.
    pub rows: Vec<MeshingRow>,
    /// Time per element at the largest size over that at the smallest: 1 if the cost is linear.
    pub linearity: Option<f64>,
    /// Worker threads.
    pub threads: usize,
}

impl Study for MeshingBench {
    const NAME: &'static str = "meshing";
    const KIND: Kind = Kind::Bench;
    type Figures = MeshingResult;

    fn run(&self, job: &Job<'_>) -> Result<(MeshingResult, Document)> {
        let surfaces = self.surfaces()?;
        job.claim()?;
        job.progress.begin("meshes", (self.sizes.len() + 3 * surfaces.len()) as u64);
        let mut rows = Vec::new();
        let mut measure =
            |name: &str, series: &'static str, surface: &TriMesh, mesher: &dyn Mesher, runs: usize| -> Result<()> {
                check_interrupted(job.progress)?;
                rows.push(row(name, series, surface, mesher, runs));
                job.progress.advance(1);
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
        job.progress.end();
        check_interrupted(job.progress)?;
        let per_tet = |r: Option<&MeshingRow>| r.filter(|r| r.tets > 0).map(|r| r.ns_per_tet);
        let mut of_size: Vec<&MeshingRow> = rows.iter().filter(|r| r.series == "size").collect();
        of_size.sort_by_key(|r| r.tets);
        let linearity = per_tet(of_size.last().copied()).zip(per_tet(of_size.first().copied())).map(|(a, b)| a / b);
        let result = MeshingResult { linearity, threads: rayon::current_num_threads(), rows };
        let document = document(&result)?;
        Ok((result, document))
    }
}

impl MeshingBench {
    /// The surfaces with their names, repaired if necessary.
    fn surfaces(&self) -> Result<Vec<(String, TriMesh)>> {
        if self.surfaces.is_empty() {
            return Ok(vec![("ellipsoid of 815 cm3".into(), ellipsoid(LIVER.into(), 3e-3))]);
        }
        let read = |path: &PathBuf| -> Result<(String, TriMesh)> {
            let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let raw = read_surface(path, self.units.into())?;
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

fn document(result: &MeshingResult) -> Result<Document> {
    let of = |series: &'static str| result.rows.iter().filter(move |r| r.series == series);
    let points = |f: &dyn Fn(&MeshingRow) -> f64| -> Vec<(f64, f64)> {
        let mut points: Vec<_> = of("size").filter(|r| r.tets > 0).map(|r| (r.tets as f64 / 1e3, f(r))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let plot = |title: &'static str, y: &'static str, points: Vec<(f64, f64)>| {
        let line = Line::new(points, colors::organ(0));
        let x = "tetrahedra (thousands)";
        let plot = Plot { title, x, y, lines: vec![line], show: vec![0.0], ..Plot::default() };
        plot.figure(&format!("<b>{title}.</b>"))
    };
    let figures = [
        plot("Time over size", "time (s)", points(&|r| r.seconds))?,
        plot("Time per element", "time (\u{b5}s)", points(&|r| 1e-3 * r.ns_per_tet))?,
    ];
    let linear = result.linearity.map_or(String::new(), |ratio| {
        format!(" Time per element at the largest size over that at the smallest: {}.", fixed(ratio, 2))
    });
    let lead = format!("The lattice mesher on one surface at increasing sizes, {} threads.{linear}", result.threads);
    let cost = Section::new("Cost", lead).figures(figures).table(rows(of("size")));
    let peers = Section::new(
        "Comparison",
        "One surface, one run each on the same machine. The lattice mesher at the default settings (2.2 mm, or about \
         50,000 elements), TetGen with those of the paper, fTetWild with its own. The times of the last two include \
         the start of their process.",
    )
    .table(rows(of("peers")));
    Ok(Document::new("Meshing", "From closed surfaces to tetrahedra").with(cost).with(peers))
}

fn rows<'a>(rows: impl Iterator<Item = &'a MeshingRow>) -> Table {
    let head = [
        "Surface",
        "Mesher",
        "Nodes",
        "Tetrahedra",
        "Time (s)",
        "(ns/tet)",
        "Dihedral min.",
        "median",
        "max.",
        "Inverted",
        "Edge (mm)",
        "Volume",
    ];
    let row = |r: &MeshingRow| match &r.failure {
        Some(why) => vec![r.surface.clone(), r.mesher.clone(), why.clone()],
        None => vec![
            r.surface.clone(),
            r.mesher.clone(),
            count(r.nodes),
            count(r.tets),
            fixed(r.seconds, 2),
            fixed(r.ns_per_tet, 0),
            format!("{}\u{b0}", fixed(r.min_dihedral_deg, 1)),
            format!("{}\u{b0}", fixed(r.median_dihedral_deg, 1)),
            format!("{}\u{b0}", fixed(r.max_dihedral_deg, 1)),
            count(r.inverted),
            fixed(r.median_edge_mm, 2),
            percent(r.volume_error, 2),
        ],
    };
    Table::new(head, rows.map(row).collect())
}
