//! `trocar segment`.

use crate::{cli, output};
use trocar_core::Progress;
use trocar_workflow::{Result, Segment, Segmented, Wanted, wanted_weights};

pub fn run(arguments: &cli::Segment, json: bool, progress: &dyn Progress) -> Result<()> {
    // clap asks for both unless the files are asked for.
    let (Some(recording), Some(masks), false) = (&arguments.recording, &arguments.output, arguments.weights) else {
        output::print(json, &wanted_weights(arguments.sam.folder.as_deref()), |files| list(files));
        return Ok(());
    };
    let segment = Segment { sam: arguments.sam.folder.clone(), onnxruntime: arguments.sam.onnxruntime.clone() };
    output::print(json, &segment.run(recording, masks, progress)?, text);
    Ok(())
}

fn list(files: &[Wanted]) -> String {
    let line = |w: &Wanted| {
        let state =
            w.found.as_ref().map_or_else(|| format!("missing; {}", w.how_to_get), |path| format!("found: {path}"));
        format!("{}\n  {}\n  {state}", w.name, w.purpose)
    };
    files.iter().map(line).collect::<Vec<_>>().join("\n")
}

fn text(s: &Segmented) -> String {
    let mut lines: Vec<String> = s.organs.iter().map(|(name, pixels)| format!("{name}: {pixels} pixels")).collect();
    lines.push(format!("instruments: {}; on {:.1}% of the image in the mean", s.instruments, 100.0 * s.covered));
    lines.push(format!(
        "masks of {} frames in {} ({:.1} s); look at the pictures beside them",
        s.frames, s.masks, s.seconds
    ));
    lines.join("\n")
}
