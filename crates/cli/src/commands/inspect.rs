//! `trocar inspect`.

use crate::cli::Inspect;
use crate::output;
use trocar_camera::Camera;
use trocar_workflow::{Inspection, Result, inspect};

pub fn run(arguments: &Inspect, json: bool) -> Result<()> {
    let inspection = inspect(&arguments.recording, arguments.template)?;
    output::print(json, &inspection, text);
    Ok(())
}

fn text(i: &Inspection) -> String {
    let camera = |c: &Camera| {
        format!("{} x {}, f {:.1} {:.1}, centre {:.1} {:.1} px", c.width, c.height, c.fx, c.fy, c.cx, c.cy)
    };
    let mut lines =
        vec![format!("{}: {} frames", i.recording, i.frames), format!("camera        {}", camera(&i.camera))];
    if let Some(depth) = &i.depth_camera {
        lines.push(format!("depth camera  {}; registered to colour", camera(depth)));
    }
    lines.push(format!(
        "depth         unit {} mm; the middle frame has depth on {:.0}% of its pixels, from {:.0} to {:.0} mm",
        1e3 * i.depth_scale_m,
        100.0 * i.coverage,
        1e3 * i.depth_range_m[0],
        1e3 * i.depth_range_m[1]
    ));
    let organs = match (i.organs.is_empty(), i.missing.is_empty()) {
        (false, _) => i.organs.join(", "),
        (true, true) => "none described yet".to_owned(),
        (true, false) => "none with a mask, a polygon or points".to_owned(),
    };
    lines.push(format!("organs        {organs}"));
    lines.extend(i.missing.iter().map(|m| format!("missing       {m}")));
    lines.extend(i.topics.iter().map(|t| format!("topic         {t}")));
    lines.extend(i.notes.iter().map(|n| format!("note: {n}")));
    lines.extend(i.written.iter().map(|w| format!("wrote {w}")));
    lines.join("\n")
}
