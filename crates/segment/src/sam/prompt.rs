//! The decoder's input and output: prompts and mask logits.

use super::resample::bilinear;
use crate::distance::innermost;
use crate::error::Result;
use crate::picture::{Picture, Target};
use crate::polygon::fill_polygon;
use trocar_camera::Mask;

/// The decoder's prompt: points (px of the picture) with SAM's labels (1 on, 0 off, 2 and 3 a box's
/// corners), and initial mask logits.
#[derive(Clone, Debug, Default)]
pub(super) struct Prompt {
    pub points: Vec<([f64; 2], f32)>,
    pub mask: Option<Logits>,
}

/// A mask before the threshold at 0.
#[derive(Clone, Debug)]
pub(super) struct Logits {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl Prompt {
    /// The prompt of a target: its points, and its box or outline.
    pub fn new(picture: &Picture<'_>, target: &Target) -> Result<Self> {
        picture.check()?;
        target.check()?;
        let (width, height) = (picture.color.width, picture.color.height);
        let mut points = Vec::new();
        for (list, label, field) in [(&target.points, 1.0, "points"), (&target.points_outside, 0.0, "points_outside")] {
            for &[x, y] in list {
                if !(-0.5..width as f64 - 0.5).contains(&x) || !(-0.5..height as f64 - 0.5).contains(&y) {
                    let text = format!("{field} has [{x}, {y}], outside {}'s {width} x {height} pixels", picture.name);
                    return Err(target.error(text));
                }
                points.push(([x, y], label));
            }
        }
        let mut corners = target.box_px;
        if target.points.is_empty() && corners.is_none() {
            if target.polygon.is_empty() {
                return Err(target.error("it has no prompt; give points on it, a box_px or a polygon"));
            }
            let filled = fill_polygon(width, height, &target.polygon);
            let Some(middle) = innermost(&filled.set, width, height) else {
                return Err(target.error(format!("polygon covers no pixel of {}", picture.name)));
            };
            points.push(([(middle % width) as f64, (middle / width) as f64], 1.0));
            let extent = |axis: usize| {
                let all = target.polygon.iter().map(|p| p[axis]);
                (all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max))
            };
            let ((left, right), (top, bottom)) = (extent(0), extent(1));
            corners = Some([left, top, right, bottom]);
        }
        if let Some([left, top, right, bottom]) = corners {
            let inside = |x: f64, y: f64| [x.clamp(0.0, width as f64 - 1.0), y.clamp(0.0, height as f64 - 1.0)];
            points.push((inside(left, top), 2.0));
            points.push((inside(right, bottom), 3.0));
        }
        Ok(Self { points, mask: None })
    }
}

impl Logits {
    /// The mask at a picture's size: logits above 0.
    pub fn mask(&self, width: usize, height: usize) -> Mask {
        let values = bilinear(&self.values, [self.width, self.height], [width, height]);
        Mask { width, height, set: values.into_iter().map(|l| l > 0.0).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_camera::ColorImage;

    #[test]
    fn prompts_are_points_with_sams_labels() {
        let color = ColorImage::new(100, 50, [0; 3]);
        let picture = Picture { color: &color, depth: None, name: "composite" };
        let mut target = Target { name: "liver".into(), ..Target::default() };
        let message = Prompt::new(&picture, &target).unwrap_err().to_string();
        assert!(message.contains("liver") && message.contains("points"), "{message}");

        target.polygon = vec![[10.0, 10.0], [31.0, 10.0], [31.0, 31.0], [10.0, 31.0]];
        let points = Prompt::new(&picture, &target).unwrap().points;
        assert_eq!(points, [([20.0, 20.0], 1.0), ([10.0, 10.0], 2.0), ([31.0, 31.0], 3.0)]);

        target.points = vec![[5.0, 6.0]];
        target.points_outside = vec![[90.0, 40.0]];
        assert_eq!(Prompt::new(&picture, &target).unwrap().points, [([5.0, 6.0], 1.0), ([90.0, 40.0], 0.0)]);
        target.box_px = Some([-5.0, 1.0, 300.0, 20.0]);
        assert_eq!(Prompt::new(&picture, &target).unwrap().points[2..], [([0.0, 1.0], 2.0), ([99.0, 20.0], 3.0)]);

        target.points.push([100.0, 3.0]);
        let message = Prompt::new(&picture, &target).unwrap_err().to_string();
        assert!(message.contains("outside composite's 100 x 50"), "{message}");
    }
}
