//! The inputs of a segmenter, and the trait.

use crate::error::{Error, Result};
use trocar_camera::{ColorImage, DepthImage, Mask};

/// One picture of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// The colours.
    pub color: &'a ColorImage,
    /// Depth of the same pixels (m), if any; ignored when its size differs from the colour's.
    pub depth: Option<&'a DepthImage>,
    /// Its name in messages: `frame 12`, `composite`.
    pub name: &'a str,
}

/// The target: a name, and what the user marked, in pixels of the colour image. A segmenter uses
/// what it can, and its error says what it needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// Name, as in `masks/<name>.png`.
    pub name: String,
    /// Outline (px); empty if none was drawn.
    pub polygon: Vec<[f64; 2]>,
    /// Points on the target (px).
    pub points: Vec<[f64; 2]>,
    /// Points outside the target (px).
    pub points_outside: Vec<[f64; 2]>,
    /// Box around it: left, top, right, bottom (px).
    pub box_px: Option<[f64; 4]>,
}

/// Finds a target in a picture.
pub trait Segmenter: Sync {
    /// The target's pixels; the mask has the picture's size.
    ///
    /// # Errors
    /// When the target lacks what this segmenter needs, or its files cannot be used.
    fn segment(&self, picture: &Picture<'_>, target: &Target) -> Result<Mask>;

    /// One line for reports: what this is, and the source of its weights or masks.
    fn describe(&self) -> String;
}

impl Picture<'_> {
    /// Refuses a picture without pixels, or whose pixel count differs from its size.
    pub(crate) fn check(&self) -> Result<()> {
        let ColorImage { width, height, pixels } = self.color;
        if *width == 0 || *height == 0 || width.checked_mul(*height) != Some(pixels.len()) {
            let reason = format!("{width} x {height} with {} pixels; it must have width x height pixels", pixels.len());
            return Err(Error::Picture { picture: self.name.to_owned(), reason });
        }
        Ok(())
    }

    /// The depth, if it has this picture's size.
    pub(crate) fn matching_depth(&self) -> Option<&DepthImage> {
        let n = self.color.pixels.len();
        self.depth.filter(|d| (d.width, d.height) == (self.color.width, self.color.height) && d.depth.len() == n)
    }
}

impl Target {
    /// An error about this target.
    pub(crate) fn error(&self, reason: impl Into<String>) -> Error {
        Error::Target { target: self.name.clone(), reason: reason.into() }
    }

    /// Refuses coordinates that are not finite, an outline of one or two points, and an inverted
    /// box.
    pub(crate) fn check(&self) -> Result<()> {
        let lists = [("polygon", &self.polygon), ("points", &self.points), ("points_outside", &self.points_outside)];
        for (name, list) in lists {
            if list.iter().flatten().any(|c| !c.is_finite()) {
                return Err(self.error(format!("{name} has a coordinate that is not a finite number")));
            }
        }
        if matches!(self.polygon.len(), 1 | 2) {
            return Err(self.error("polygon has fewer than 3 points; it must have at least 3"));
        }
        if let Some([left, top, right, bottom]) = self.box_px
            && !(left < right && top < bottom && (right - left).is_finite() && (bottom - top).is_finite())
        {
            let text = format!(
                "box_px is [{left}, {top}, {right}, {bottom}]; it must be left, top, right, bottom with left < right and top < bottom"
            );
            return Err(self.error(text));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_targets_are_refused_with_the_fields_name() {
        let whole = Target { name: "liver".into(), points: vec![[1.0, 2.0]], ..Target::default() };
        assert!(whole.check().is_ok());
        let wrong = [
            ("polygon", Target { polygon: vec![[0.0, 0.0], [1.0, 1.0]], ..whole.clone() }),
            ("points", Target { points: vec![[f64::NAN, 0.0]], ..whole.clone() }),
            ("points_outside", Target { points_outside: vec![[0.0, f64::INFINITY]], ..whole.clone() }),
            ("box_px", Target { box_px: Some([5.0, 0.0, 1.0, 9.0]), ..whole.clone() }),
            ("box_px", Target { box_px: Some([5.0, 0.0, f64::NAN, 9.0]), ..whole }),
        ];
        for (field, target) in wrong {
            let message = target.check().unwrap_err().to_string();
            assert!(message.contains("liver") && message.contains(field), "{message}");
        }
    }

    #[test]
    fn a_picture_has_its_pixels_and_depth_of_its_size() {
        let color = ColorImage::new(4, 3, [0; 3]);
        let (same, other) = (DepthImage::new(4, 3), DepthImage::new(3, 4));
        let picture = |depth| Picture { color: &color, depth, name: "frame 7" };
        assert!(picture(None).check().is_ok());
        assert!(picture(Some(&same)).matching_depth().is_some() && picture(Some(&other)).matching_depth().is_none());
        let torn = ColorImage { width: 5, ..color.clone() };
        let message = Picture { color: &torn, depth: None, name: "frame 7" }.check().unwrap_err().to_string();
        assert!(message.starts_with("frame 7: 5 x 3 with 12 pixels"), "{message}");
    }
}
