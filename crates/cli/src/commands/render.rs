//! `trocar render`.

use crate::cli::Render;
use crate::output;
use trocar_core::Progress;
use trocar_workflow::{Rendered, Rendering, Result, counted};

/// Default number of paths per pixel, and that of pictures whose noise is filtered out.
const SAMPLES: u32 = 64;
const DENOISED_SAMPLES: u32 = 16;

pub fn run(arguments: &Render, json: bool, progress: &dyn Progress) -> Result<()> {
    let samples = if arguments.denoise { DENOISED_SAMPLES } else { SAMPLES };
    let rendering = Rendering {
        source: arguments.source.clone(),
        camera: arguments.camera.clone(),
        size: arguments.size,
        samples: arguments.path.then(|| arguments.samples.unwrap_or(samples)),
        denoise: arguments.denoise,
        depth: arguments.depth,
        labels: arguments.labels,
        at: arguments.at,
        noise: arguments.noise,
        cut_away: arguments.cut_away,
        threads: arguments.threads,
        phantoms: arguments.phantoms.clone(),
        specimen: arguments.specimen.clone(),
    };
    output::print(json, &rendering.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &Rendered) -> String {
    let seen: Vec<String> = r.seen.iter().map(|s| format!("{} {:.1}%", s.name, 1e2 * s.share)).collect();
    let how = if r.samples > 0 {
        let filtered = if r.denoised { ", noise filtered out" } else { "" };
        format!("{} per pixel{filtered}", counted(r.samples as usize, "path"))
    } else {
        "direct light".to_owned()
    };
    let note = r
        .differs
        .as_ref()
        .map_or(String::new(), |why| format!("\nthe replay differs from the recorded episode: {why}"));
    format!(
        "{}: {} x {}, {}, {how}, {} triangles, {:.1} s; at {:.2} s\n{}\n{}{note}",
        r.camera,
        r.width,
        r.height,
        counted(r.frames, "frame"),
        r.triangles,
        r.render_s,
        r.time_s,
        seen.join(", "),
        r.files.join("\n")
    )
}
