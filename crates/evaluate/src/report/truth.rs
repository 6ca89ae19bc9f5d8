//! The composite against the instrument-free truth of a phantom.

use super::overlays;
use super::page::{self, Columns};
use super::{colors::DIVERGING, figures, table};
use crate::{Error, Result};
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_reconstruct::Reconstruction;

/// Unit of a phantom's truth depth [m].
const DEPTH_UNIT: f64 = 1e-4;

/// Errors of the pixels of one part of the image.
struct Part {
    name: &'static str,
    /// Depth: pixels, median and 95th percentile of the absolute error, median of the signed one [mm].
    depth: Option<(usize, f64, f64, f64)>,
    /// Colour: mean absolute difference over the three channels and its 95th percentile over pixels, of 255 levels.
    color: Option<(f64, f64)>,
}

/// The section, empty when `dir` (the folder of the truth, or the recording that holds it as `truth/`) has neither
/// `color.png` nor `depth.png`.
///
/// # Errors
/// Names the file when it is unreadable or of another size than the composite.
pub(super) fn section(r: &Reconstruction, dir: &Path) -> Result<String> {
    let find = |name: &str| [dir.join(name), dir.join("truth").join(name)].into_iter().find(|p| p.is_file());
    let fits = |path: &Path, width: usize, height: usize| {
        if (width, height) == (r.background.width, r.background.height) {
            return Ok(());
        }
        let reason =
            format!("{width} x {height} pixels; the composite has {} x {}", r.background.width, r.background.height);
        Err(Error::Truth { path: path.to_owned(), reason })
    };
    let mut color = None;
    if let Some(path) = find("color.png") {
        let image = ColorImage::read(&path)?;
        fits(&path, image.width, image.height)?;
        color = Some(image);
    }
    let mut depth = None;
    if let Some(path) = find("depth.png") {
        let image = DepthImage::read(&path, DEPTH_UNIT)?;
        fits(&path, image.width, image.height)?;
        depth = Some(image);
    }
    if color.is_none() && depth.is_none() {
        return Ok(String::new());
    }
    let under = |i: usize| r.instruments.set[i];
    let parts = [
        part("whole image", r, &color, &depth, &|_| true),
        part("under the instruments", r, &color, &depth, &under),
        part("elsewhere", r, &color, &depth, &|i| !under(i)),
    ];
    let mut figures = Vec::new();
    if let Some(truth) = &color {
        let img = figures::img(truth, "truth, seen without instruments")?;
        figures.push(page::figure(&img, "<b>Truth.</b> The phantom without instruments and without noise."));
    }
    if let Some(truth) = &depth {
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
        "The phantom is known exactly, so what the composite recovered, also under the instruments, can be checked. \
         Colour differences are of 255 levels.",
        &(page::grid(Columns::Two, &figures) + &table::plain(&head, &rows)),
    ))
}

fn error_map(r: &Reconstruction, truth: &DepthImage) -> Result<String> {
    let mut picture = overlays::dimmed(&r.background);
    let pairs = || r.depth.depth.iter().zip(&truth.depth);
    let compared =
        Mask { width: truth.width, height: truth.height, set: pairs().map(|(a, b)| *a > 0.0 && *b > 0.0).collect() };
    let error: Vec<f32> = pairs().map(|(a, b)| a - b).collect();
    overlays::error(&mut picture, &error, &compared);
    overlays::outline(&mut picture, &r.instruments, super::colors::INSTRUMENT);
    let img = figures::img(&picture, "depth error of the composite")?;
    let bar = page::scale_bar(&DIVERGING, "\u{2212}5", "composite minus true depth [mm]", "+5");
    let caption = "<b>Depth error of the composite.</b> Where the instruments stood in the centre frame is outlined.";
    Ok(page::figure(&img, &format!("{caption}{bar}")))
}

fn part(
    name: &'static str,
    r: &Reconstruction,
    color: &Option<ColorImage>,
    depth: &Option<DepthImage>,
    inside: &dyn Fn(usize) -> bool,
) -> Part {
    let filled: Vec<usize> = (0..r.depth.depth.len()).filter(|&i| r.depth.depth[i] > 0.0 && inside(i)).collect();
    let depth = depth.as_ref().and_then(|truth| {
        let signed: Vec<f64> = filled
            .iter()
            .filter(|&&i| truth.depth[i] > 0.0)
            .map(|&i| 1e3 * (f64::from(r.depth.depth[i]) - f64::from(truth.depth[i])))
            .collect();
        let size: Vec<f64> = signed.iter().map(|e| e.abs()).collect();
        Some((size.len(), quantile(&size, 0.5)?, quantile(&size, 0.95)?, quantile(&signed, 0.5)?))
    });
    let color = color.as_ref().and_then(|truth| {
        let difference = |&i: &usize| {
            let (a, b) = (r.background.pixels[i], truth.pixels[i]);
            (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0
        };
        let all: Vec<f64> = filled.iter().map(difference).collect();
        Some((all.iter().sum::<f64>() / all.len().max(1) as f64, quantile(&all, 0.95)?))
    });
    Part { name, depth, color }
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

/// Value below which the share `q` of the finite values lies (nearest rank); `None` without any.
pub(super) fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = (q * (sorted.len().saturating_sub(1)) as f64).round() as usize;
    sorted.get(rank).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_known_values() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert_eq!((quantile(&values, 0.5), quantile(&values, 0.95)), (Some(50.0), Some(95.0)));
        assert_eq!((quantile(&[], 0.5), quantile(&[f64::NAN], 0.5)), (None, None));
    }
}
