//! `trocar bench`.

mod cell;
mod episode;
mod grasp;
mod organs;
mod render;
mod scaling;

use crate::cli::{Bench, BenchName, MeshingBench};
use crate::output;
use trocar_core::Progress;
use trocar_studies::{MeshingResult, Result};

pub fn run(arguments: &Bench, json: bool, progress: &dyn Progress) -> Result<()> {
    match &arguments.name {
        BenchName::Meshing(arguments) => meshing(arguments, json, progress),
        BenchName::Cell(arguments) => cell::run(arguments, json, progress),
        BenchName::Episode(arguments) => episode::run(arguments, json, progress),
        BenchName::Grasp(arguments) => grasp::run(arguments, json, progress),
        BenchName::Organs(arguments) => organs::run(arguments, json, progress),
        BenchName::Render(arguments) => render::run(arguments, json, progress),
        BenchName::Scaling(arguments) => scaling::run(arguments, json, progress),
    }
}

fn meshing(arguments: &MeshingBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::MeshingBench {
        surfaces: arguments.surfaces.clone(),
        unit: arguments.units.into(),
        sizes: arguments.sizes.clone(),
        python: arguments.python.clone(),
    };
    let result = bench.run(&arguments.output, progress)?;
    output::print(json, &result, text);
    Ok(())
}

fn text(r: &MeshingResult) -> String {
    let header =
        ["surface", "mesher", "nodes", "tets", "s", "ns/tet", "min dih deg", "median", "inverted", "edge mm", "volume"];
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .filter(|row| row.failure.is_none())
        .map(|row| {
            vec![
                row.surface.clone(),
                row.mesher.clone(),
                row.nodes.to_string(),
                row.tets.to_string(),
                format!("{:.2}", row.seconds),
                format!("{:.0}", row.ns_per_tet),
                format!("{:.1}", row.min_dihedral_deg),
                format!("{:.1}", row.median_dihedral_deg),
                row.inverted.to_string(),
                format!("{:.2}", row.median_edge_mm),
                format!("{:+.2}%", 100.0 * row.volume_error),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for row in &r.rows {
        if let Some(why) = &row.failure {
            out += &format!("\n{}: {}: {why}", row.surface, row.mesher);
        }
    }
    if let Some(ratio) = r.linearity {
        out += &format!("\ntime per element, largest size over smallest: {ratio:.2} ({} threads)", r.threads);
    }
    out + &format!("\nreport {}", r.report)
}
