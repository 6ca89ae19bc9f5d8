//! The section that compares the composite with the truth of a phantom.

use crate::Result;
use trocar_camera::{DepthImage, Mask};
use trocar_reconstruct::Reconstruction;
use trocar_reconstruct::truth::{Part, Truth};
use trocar_report::document::Table;
use trocar_report::overlays;
use trocar_report::page::{self, Columns};
use trocar_report::{colors::DIVERGING, figures, table};

/// The section.
pub(super) fn section(r: &Reconstruction, truth: &Truth) -> Result<String> {
    let Truth { color, depth, parts } = truth;
    let mut figures = Vec::new();
    if let Some(truth) = color {
        let caption = "<b>Truth.</b> The phantom without instruments and without noise.";
        figures.push(figures::figure(truth, "truth, seen without instruments", caption)?);
    }
    if let Some(truth) = depth {
        figures.push(error_map(r, truth)?);
    }
    let rows: Vec<Vec<String>> = parts.iter().map(row).collect();
    let head = [
        "Part",
        "Pixels with depth",
        "Depth, median |error|",
        "95th percentile",
        "signed median",
        "Colour, mean",
        "95th percentile",
    ];
    Ok(page::section(
        "Composite against the truth",
        "The exact view of the phantom without instruments is known, so the composite can be checked, also under the \
         instruments. Colour differences are of 255 levels.",
        &(page::grid(Columns::Two, &figures) + &Table::new(head, rows).html()),
    ))
}

fn error_map(r: &Reconstruction, truth: &DepthImage) -> Result<String> {
    let mut picture = overlays::dimmed(&r.composite.color);
    let pairs = || r.composite.depth.depth.iter().zip(&truth.depth);
    let compared =
        Mask { width: truth.width, height: truth.height, set: pairs().map(|(a, b)| *a > 0.0 && *b > 0.0).collect() };
    let error: Vec<f32> = pairs().map(|(a, b)| a - b).collect();
    overlays::error(&mut picture, &error, &compared);
    overlays::outline(&mut picture, &r.composite.instruments, trocar_report::colors::INSTRUMENT);
    let bar = page::scale_bar(&DIVERGING, "\u{2212}5", "composite minus true depth (mm)", "+5");
    let caption = "<b>Depth error of the composite.</b> Outlined: the instruments of the centre frame.";
    Ok(figures::figure(&picture, "depth error of the composite", &format!("{caption}{bar}"))?)
}

fn row(part: &Part) -> Vec<String> {
    let dash = || "\u{2013}".to_owned();
    let mm = |v: f64| format!("{} mm", table::fixed(v, 2));
    let mut row = vec![part.name.to_owned()];
    match part.depth {
        Some((n, median, p95, signed)) => row.extend([table::count(n), mm(median), mm(p95), mm(signed)]),
        None => row.extend([dash(), dash(), dash(), dash()]),
    }
    match part.color {
        Some((mean, p95)) => row.extend([table::fixed(mean, 1), table::fixed(p95, 1)]),
        None => row.extend([dash(), dash()]),
    }
    row
}
