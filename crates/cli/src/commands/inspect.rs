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
        "depth         {} mm a unit; the middle frame has it on {:.0}% of its pixels, {:.0} to {:.0} mm",
        1e3 * i.depth_scale_m,
        100.0 * i.coverage,
        1e3 * i.depth_range_m[0],
        1e3 * i.depth_range_m[1]
    ));
    let organs = if i.organs.is_empty() { "none named yet".to_owned() } else { i.organs.join(", ") };
    lines.push(format!("organs        {organs}"));
    lines.extend(i.topics.iter().map(|t| format!("topic         {t}")));
    lines.extend(i.notes.iter().map(|n| format!("note: {n}")));
    lines.extend(i.written.iter().map(|w| format!("wrote {w}")));
    lines.join("\n")
}
