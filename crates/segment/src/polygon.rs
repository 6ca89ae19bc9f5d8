//! Masks from outlines.

use crate::{Picture, Result, Segmenter, Target};
use trocar_camera::Mask;

/// Fills the target's outline; the picture only provides the size.
#[derive(Clone, Copy, Debug, Default)]
pub struct Polygon;

impl Segmenter for Polygon {
    fn segment(&self, picture: &Picture<'_>, target: &Target) -> Result<Mask> {
        picture.check()?;
        target.check()?;
        if target.polygon.is_empty() {
            return Err(target.error("it has no polygon; draw an outline of at least 3 points"));
        }
        Ok(fill_polygon(picture.color.width, picture.color.height, &target.polygon))
    }

    fn describe(&self) -> String {
        "outline drawn by hand".into()
    }
}

/// Pixels whose centre is inside `outline` (px), by the even-odd rule.
///
/// ```
/// let square = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]];
/// assert_eq!(trocar_segment::fill_polygon(8, 8, &square).count(), 4);
/// ```
pub fn fill_polygon(width: usize, height: usize, outline: &[[f64; 2]]) -> Mask {
    let mut mask = Mask::new(width, height);
    let mut crossings = Vec::new();
    for v in 0..height {
        let y = v as f64;
        crossings.clear();
        for (i, &[x0, y0]) in outline.iter().enumerate() {
            let [x1, y1] = outline[(i + 1) % outline.len()];
            if (y0 <= y) != (y1 <= y) {
                crossings.push(x0 + (x1 - x0) * (y - y0) / (y1 - y0));
            }
        }
        crossings.sort_by(f64::total_cmp);
        for span in crossings.chunks_exact(2) {
            let first = span[0].ceil().max(0.0) as usize;
            for u in first..width {
                if u as f64 >= span[1] {
                    break;
                }
                mask.set[v * width + u] = true;
            }
        }
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_is_the_polygons() {
        let star = [[10.0, 10.0], [50.0, 12.0], [30.0, 25.0], [48.0, 55.0], [12.0, 50.0]];
        let area: f64 = (0..5)
            .map(|i| {
                let ([x0, y0], [x1, y1]) = (star[i], star[(i + 1) % 5]);
                0.5 * (x0 * y1 - x1 * y0)
            })
            .sum();
        let count = fill_polygon(64, 64, &star).count() as f64;
        assert!((count - area.abs()).abs() < 0.02 * area.abs(), "{count} pixels for an area of {area}");
        assert_eq!(fill_polygon(8, 8, &[[-9.0, -9.0], [99.0, -9.0], [99.0, 99.0], [-9.0, 99.0]]).count(), 64);
        assert_eq!(fill_polygon(8, 8, &[[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]]).count(), 4);
    }

    #[test]
    fn a_target_needs_an_outline() {
        let color = trocar_camera::ColorImage::new(8, 8, [0; 3]);
        let picture = Picture { color: &color, depth: None, name: "composite" };
        let mut target = Target { name: "cecum".into(), ..Target::default() };
        assert!(Polygon.segment(&picture, &target).unwrap_err().to_string().contains("cecum"));
        target.polygon = vec![[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]];
        assert_eq!(Polygon.segment(&picture, &target).unwrap().count(), 4);
    }
}
