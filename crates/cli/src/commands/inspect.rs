//! `trocar inspect`.

use crate::cli::Inspect;
use crate::output;
use trocar_camera::Camera;
use trocar_workflow::{Inspection, Result, counted, inspect};

pub fn run(arguments: &Inspect, json: bool) -> Result<()> {
    let inspection = inspect(&arguments.recording, arguments.template)?;
    output::print(json, &inspection, text);
    Ok(())
}

fn text(i: &Inspection) -> String {
    let camera = |c: &Camera| {
        format!("{} x {}, f {:.1} {:.1}, centre {:.1} {:.1} px", c.width, c.height, c.fx, c.fy, c.cx, c.cy)
    };
    let mut lines = vec![
        format!("{}: {}", i.recording, counted(i.frames, "frame")),
        format!("camera        {}", camera(&i.camera)),
    ];
    if let Some(depth) = &i.depth_camera {
        lines.push(format!("depth camera  {}; registered to colour", camera(depth)));
    }
    let unit = 1e3 * i.depth_scale_m;
    lines.push(if i.coverage > 0.0 {
        let (share, [near, far]) = (100.0 * i.coverage, i.depth_range_m.map(|m| 1e3 * m));
        format!(
            "depth         unit {unit} mm; the middle frame has depth on {share:.0}% of its pixels, from {near:.0} to {far:.0} mm"
        )
    } else {
        format!("depth         unit {unit} mm; the middle frame has no depth")
    });
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
