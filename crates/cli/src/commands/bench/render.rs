//! `trocar bench render`.

use crate::cli::RenderBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{RenderBenchResult, Result};

pub fn run(arguments: &RenderBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::RenderBench {
        triangles: arguments.triangles,
        samples: arguments.samples,
        rays: arguments.rays,
        python: arguments.python.clone(),
        picture: arguments.picture.clone(),
        scene: (arguments.scene != "none").then(|| arguments.scene.clone()),
        phantoms: arguments.phantoms.clone(),
    };
    output::print(json, &bench.run(progress)?, text);
    Ok(())
}

fn text(r: &RenderBenchResult) -> String {
    let million = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{:.2}", 1e-6 * x));
    let rows: Vec<Vec<String>> = r
        .rays
        .iter()
        .map(|row| {
            vec![
                row.kind.to_owned(),
                row.rays.to_string(),
                million(Some(row.rays_per_second)),
                million(row.embree_rays_per_second),
                row.ratio.map_or("-".into(), |x| format!("{x:.2}")),
                row.differing.map_or("-".into(), |x| x.to_string()),
                row.largest_difference_m.map_or("-".into(), |x| format!("{:.2}", 1e6 * x)),
            ]
        })
        .collect();
    let header = ["rays", "count", "ours M/s", "Embree M/s", "ratio", "differ", "most um"];
    let mut out = String::new();
    if let Some(cell) = &r.cell {
        out += &format!(
            "{}: {} triangles, made in {:.0} ms; following the cell {:.2} ms\n",
            cell.scene, cell.triangles, cell.begin_ms, cell.follow_ms
        );
        for c in &cell.cameras {
            out += &format!(
                "  {:>10} 224 x 224: {:.1} ms with shadows (best {:.1}), {:.1} without\n",
                c.camera, c.ms, c.best_ms, c.unshadowed_ms
            );
        }
    }
    out += &format!(
        "loops of bowel: {} triangles, {} of them refitted; {} threads ({} cores{})\n\
         preview 224 x 224: {:.1} ms a frame with shadows, {:.1} without, refit included; all trees anew {:.0} ms\n",
        r.triangles,
        r.refitted_triangles,
        r.threads,
        r.machine.cores,
        r.machine.load.map_or(String::new(), |l| format!(", load {l:.1}")),
        r.loops_224_ms,
        r.loops_224_unshadowed_ms,
        r.build_ms,
    );
    if let Some(ms) = r.path_720p_ms {
        out += &format!("paths 1280 x 720, {} a pixel: {:.1} s\n", r.samples, 1e-3 * ms);
    }
    out += &output::table(&header, &rows);
    if let Some(why) = &r.embree_failure {
        out += &format!("\nEmbree: {why}");
    }
    out
}
