//! `trocar segment`.

use crate::{cli, output};
use trocar_core::Progress;
use trocar_workflow::{Result, Segment, Segmented, WeightFile, counted, weight_files};

pub fn run(arguments: &cli::Segment, json: bool, progress: &dyn Progress) -> Result<()> {
    // clap requires both unless --weights is given.
    let (Some(recording), Some(masks), false) = (&arguments.recording, &arguments.output, arguments.weights) else {
        output::print(json, &weight_files(arguments.sam.folder.as_deref()), |files| list(files));
        return Ok(());
    };
    let segment = Segment { sam: arguments.sam.folder.clone(), onnxruntime: arguments.sam.onnxruntime.clone() };
    output::print(json, &segment.run(recording, masks, progress)?, text);
    Ok(())
}

fn list(files: &[WeightFile]) -> String {
    let line = |w: &WeightFile| {
        let state =
            w.found.as_ref().map_or_else(|| format!("missing; {}", w.how_to_get), |path| format!("found: {path}"));
        format!("{}\n  {}\n  {state}", w.name, w.purpose)
    };
    files.iter().map(line).collect::<Vec<_>>().join("\n")
}

fn text(s: &Segmented) -> String {
    let mut lines: Vec<String> =
        s.organs.iter().map(|(name, pixels)| format!("{name}: {}", counted(*pixels, "pixel"))).collect();
    if s.frames == 0 {
        lines.push(format!("instruments: {}", s.instruments));
    } else {
        let covered = 100.0 * s.covered;
        lines.push(format!("instruments: {}; they cover {covered:.1}% of the image on average", s.instruments));
        lines.push(format!("masks of {}", counted(s.frames, "frame")));
    }
    lines.push(format!("written to {} in {:.1} s; check the pictures beside the masks", s.masks, s.seconds));
    lines.join("\n")
}
