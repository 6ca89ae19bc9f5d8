//! Compares the composite with the instrument-free truth of a phantom.

use crate::{Error, Reconstruction, Result};
use serde::Serialize;
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage};

/// Unit of a phantom's truth depth (m).
pub const DEPTH_UNIT: f64 = 1e-4;

/// The camera's view without instruments and noise, and how a composite differs from it.
pub struct Truth {
    /// Its colours.
    pub color: Option<ColorImage>,
    /// Its depth.
    pub depth: Option<DepthImage>,
    /// The errors in the whole image, in the part under the instruments, and in the rest.
    pub parts: [Part; 3],
}

/// Errors of the pixels of one part of the image.
pub struct Part {
    /// Its name.
    pub name: &'static str,
    /// Depth: pixels, median and 95th percentile of the absolute error, median of the signed error
    /// (mm).
    pub depth: Option<(usize, f64, f64, f64)>,
    /// Colour: mean absolute difference over the three channels, and its 95th percentile over
    /// pixels, of 255 levels.
    pub color: Option<(f64, f64)>,
}

/// Errors of the composite against the truth.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct TruthFigures {
    /// Median absolute error of depth (mm).
    pub depth_error_median_mm: f64,
    /// 95th percentile of the absolute error of depth (mm).
    pub depth_error_p95_mm: f64,
    /// Median error of depth, composite minus truth (mm).
    pub depth_error_signed_mm: f64,
    /// Median absolute error of depth under the instruments of the window's centre frame (mm).
    pub under_instruments_median_mm: Option<f64>,
    /// Mean absolute difference of colour, of 255 levels.
    pub color_error_mean: Option<f64>,
}

impl Truth {
    /// Reads `color.png` and `depth.png` in the folder `dir` of the truth, or in `truth/` of the
    /// recording `dir`; `None` without either. All images of `r` must have one size.
    ///
    /// # Errors
    /// Names the file when it is unreadable or of another size than the composite.
    pub fn read(r: &Reconstruction, dir: &Path) -> Result<Option<Self>> {
        let find = |name: &str| [dir.join(name), dir.join("truth").join(name)].into_iter().find(|p| p.is_file());
        let fits = |path: &Path, width: usize, height: usize| {
            let size = (r.composite.color.width, r.composite.color.height);
            if (width, height) == size {
                return Ok(());
            }
            let reason = format!("it has {width} x {height} pixels; the composite has {} x {}", size.0, size.1);
            Err(Error::Input { path: path.to_owned(), reason })
        };
        let (mut true_color, mut true_depth) = (None, None);
        if let Some(path) = find("color.png") {
            let image = ColorImage::read(&path)?;
            fits(&path, image.width, image.height)?;
            true_color = Some(image);
        }
        if let Some(path) = find("depth.png") {
            let image = DepthImage::read(&path, DEPTH_UNIT)?;
            fits(&path, image.width, image.height)?;
            true_depth = Some(image);
        }
        if true_color.is_none() && true_depth.is_none() {
            return Ok(None);
        }
        let (color, depth) = (true_color.as_ref(), true_depth.as_ref());
        let under = |i: usize| r.composite.instruments.set[i];
        let parts = [
            Part::of("whole image", r, (color, depth), &|_| true),
            Part::of("under the instruments", r, (color, depth), &under),
            Part::of("elsewhere", r, (color, depth), &|i| !under(i)),
        ];
        Ok(Some(Self { color: true_color, depth: true_depth, parts }))
    }

    /// The figures; `None` without true depth.
    pub fn figures(&self) -> Option<TruthFigures> {
        let [whole, under, _] = &self.parts;
        let (_, depth_error_median_mm, depth_error_p95_mm, depth_error_signed_mm) = whole.depth?;
        Some(TruthFigures {
            depth_error_median_mm,
            depth_error_p95_mm,
            depth_error_signed_mm,
            under_instruments_median_mm: under.depth.map(|d| d.1),
            color_error_mean: whole.color.map(|c| c.0),
        })
    }
}

impl Part {
    /// Of the pixels `inside`, against the true colours and the true depth.
    fn of(
        name: &'static str,
        r: &Reconstruction,
        (color, depth): (Option<&ColorImage>, Option<&DepthImage>),
        inside: &dyn Fn(usize) -> bool,
    ) -> Self {
        let filled: Vec<usize> =
            (0..r.composite.depth.depth.len()).filter(|&i| r.composite.depth.depth[i] > 0.0 && inside(i)).collect();
        let depth = depth.and_then(|truth| {
            let signed: Vec<f64> = filled
                .iter()
                .filter(|&&i| truth.depth[i] > 0.0)
                .map(|&i| 1e3 * (f64::from(r.composite.depth.depth[i]) - f64::from(truth.depth[i])))
                .collect();
            let size: Vec<f64> = signed.iter().map(|e| e.abs()).collect();
            Some((size.len(), quantile(&size, 0.5)?, quantile(&size, 0.95)?, quantile(&signed, 0.5)?))
        });
        let color = color.and_then(|truth| {
            let difference = |&i: &usize| {
                let (a, b) = (r.composite.color.pixels[i], truth.pixels[i]);
                (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0
            };
            let all: Vec<f64> = filled.iter().map(difference).collect();
            Some((all.iter().sum::<f64>() / all.len().max(1) as f64, quantile(&all, 0.95)?))
        });
        Self { name, depth, color }
    }
}

/// Value below which the share `q` of the finite values is (nearest rank); `None` without any.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let rank = (q * finite.len().saturating_sub(1) as f64).round() as usize;
    (rank < finite.len()).then(|| *finite.select_nth_unstable_by(rank, f64::total_cmp).1)
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
