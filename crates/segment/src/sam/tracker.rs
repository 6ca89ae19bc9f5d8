//! Follows a target through a recording.

use super::Sam2;
use super::prompt::{Logits, Prompt};
use crate::distance::innermost;
use crate::{Error, Picture, Result, Target};
use trocar_camera::{ColorImage, Mask};

/// Follows one target from picture to picture by mask prompts: each picture's decoder gets the mask
/// logits of the picture before, and a click on that mask's innermost pixel. This follows motion
/// that is small against the target's size, as at 30 pictures per second. A decoder without a mask
/// input gets the mask's box instead.
///
/// SAM 2's video memory (memory encoder and memory attention) is *not* used: the public exports of
/// these two networks differ in their inputs and in what they leave to the caller, so code for them
/// could not be tested. The consequence: a target that was fully hidden is found again only where
/// it was last seen, and similar objects that touch it may be included.
#[derive(Debug)]
pub struct Tracker<'a> {
    sam: &'a Sam2,
    state: Option<State>,
}

/// The last non-empty mask.
#[derive(Debug)]
struct State {
    target: Target,
    logits: Logits,
    mask: Mask,
}

impl<'a> Tracker<'a> {
    /// A tracker without a target.
    pub fn new(sam: &'a Sam2) -> Self {
        Self { sam, state: None }
    }

    /// Finds the target in the first picture from the user's marks; forgets an earlier target.
    ///
    /// # Errors
    /// As [`crate::Segmenter::segment`], and when the mask is empty.
    pub fn start(&mut self, picture: &Picture<'_>, target: &Target) -> Result<Mask> {
        self.state = None;
        let logits = self.sam.decode(picture.color, &Prompt::new(picture, target)?)?;
        let mask = logits.mask(picture.color.width, picture.color.height);
        if mask.count() == 0 {
            let text = format!("it is not found in {}; mark it with more points", picture.name);
            return Err(target.error(text));
        }
        self.state = Some(State { target: target.clone(), logits, mask: mask.clone() });
        Ok(mask)
    }

    /// Finds the target in the next picture. The mask is empty where the target is not visible; the
    /// last visible one is then kept for the following pictures.
    ///
    /// # Errors
    /// Before [`Tracker::start`], for a picture of another size, and when the network fails.
    pub fn next(&mut self, picture: &Picture<'_>) -> Result<Mask> {
        picture.check()?;
        let ColorImage { width, height, .. } = *picture.color;
        let wrong = |reason: String| Error::Picture { picture: picture.name.to_owned(), reason };
        let state = self.state.as_mut().ok_or_else(|| wrong("there is no target; start the tracker first".into()))?;
        if (state.mask.width, state.mask.height) != (width, height) {
            let (w, h) = (state.mask.width, state.mask.height);
            return Err(wrong(format!(
                "it has {width} x {height} pixels, but '{}' was found in {w} x {h}",
                state.target.name
            )));
        }
        let mut prompt = Prompt::default();
        if let Some(middle) = innermost(&state.mask.set, width, height) {
            prompt.points.push(([(middle % width) as f64, (middle / width) as f64], 1.0));
        }
        if self.sam.takes_masks() {
            prompt.mask = Some(state.logits.clone());
        } else if let Some([left, top, right, bottom]) = bounds(&state.mask) {
            prompt.points.push(([left, top], 2.0));
            prompt.points.push(([right, bottom], 3.0));
        }
        let logits = self.sam.decode(picture.color, &prompt)?;
        let mask = logits.mask(width, height);
        if mask.count() > 0 {
            state.logits = logits;
            state.mask = mask.clone();
        }
        Ok(mask)
    }
}

/// Left, top, right and bottom pixel of a mask.
fn bounds(mask: &Mask) -> Option<[f64; 4]> {
    let mut set = (0..mask.set.len()).filter(|i| mask.set[*i]).map(|i| (i % mask.width, i / mask.width));
    let (u, v) = set.next()?;
    let (left, top, right, bottom) =
        set.fold((u, v, u, v), |(l, t, r, b), (u, v)| (l.min(u), t.min(v), r.max(u), b.max(v)));
    Some([left, top, right, bottom].map(|c| c as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_enclose_the_mask() {
        let mut mask = Mask::new(9, 7);
        assert_eq!(bounds(&mask), None);
        for i in [2 * 9 + 4, 5 * 9 + 3, 4 * 9 + 7] {
            mask.set[i] = true;
        }
        assert_eq!(bounds(&mask), Some([3.0, 2.0, 7.0, 5.0]));
    }
}
