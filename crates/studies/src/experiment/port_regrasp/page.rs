//! The page of re-grasps through arm and port.

use super::result::{PortRegraspResult, Regrasp};
use crate::Result;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page;
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, or_dash};

/// Length of a control period (s).
const PERIOD_S: f64 = 1.0 / 30.0;

pub(super) fn document(r: &PortRegraspResult) -> Result<Document> {
    let lead = format!(
        "The grasper takes hold of the appendix at s = {}, drags it, lets go and grasps again where it is. The second \
         grasp ties nodes to their places at rest, or to where they are. The paper\u{2019}s articulated cell reached \
         an RCM deviation of 16.4 mm with rest-pose capture and was beyond 3 mm in 6 of 60 control steps; with \
         live-pose capture in none.",
        fixed(r.at, 2)
    );
    let section = Section::new("RCM deviation after a second grasp", lead).figures([plot(r)?]).table(table(r));
    Ok(Document::new("Re-grasp in a port", "RCM deviation over two seconds after a second grasp").with(section))
}

/// A run in words.
fn name(row: &Regrasp) -> String {
    let rules = if row.rules { "rules" } else { "no rules" };
    format!("{}, {} mm, {rules}", row.design, fixed(row.drag_mm, 0))
}

fn plot(r: &PortRegraspResult) -> Result<String> {
    let points = |row: &Regrasp| {
        let timed = row.rcm_mm.iter().enumerate();
        timed.map(|(k, mm)| (PERIOD_S * (k + 1) as f64, *mm)).collect::<Vec<_>>()
    };
    let lines = r.rows.iter().enumerate().map(|(k, row)| Line::new(points(row), colors::organ(k))).collect();
    let plot = Plot {
        title: "RCM deviation",
        x: "time since the second grasp (s)",
        y: "largest of both arms (mm)",
        lines,
        show: vec![0.0],
        ..Plot::default()
    };
    let names: Vec<String> = r.rows.iter().map(name).collect();
    let legend = page::legend(names.iter().enumerate().map(|(k, n)| (n.as_str(), colors::organ(k))));
    Ok(plot.figure(&format!("Largest RCM deviation of each control period.{legend}"))?)
}

fn table(r: &PortRegraspResult) -> Table {
    let over = format!("Steps beyond {} mm", fixed(r.threshold_mm, 0));
    Table::of(
        &r.rows,
        &[
            ("Second grasp", &|row| row.design.clone()),
            ("Rules", &|row| if row.rules { "on" } else { "off" }.to_owned()),
            ("Drag (mm)", &|row| fixed(row.drag_mm, 0)),
            ("Displaced (mm)", &|row| or_dash(row.displaced_mm, 1)),
            ("Snap (mm)", &|row| or_dash(row.snap_mm, 1)),
            ("Pull (N)", &|row| fixed(row.pull_n, 2)),
            ("Largest RCM deviation (mm)", &|row| fixed(row.rcm_peak_mm, 3)),
            (over.as_str(), &|row| format!("{} of {}", row.steps_over, row.steps)),
            ("Warnings", &|row| row.warnings.to_string()),
            ("Remarks", &|row| match &row.divergence {
                Some(why) => why.clone(),
                None if row.grasped_twice => String::new(),
                None => "no second grasp".to_owned(),
            }),
        ],
    )
}
