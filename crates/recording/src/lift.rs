//! Grasp-lifts of a recording: the intervals in which an instrument lifts tissue.

use serde::{Deserialize, Serialize};
use trocar_camera::Camera;

/// A marked interval in which an instrument has grasped tissue and lifts it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiftInfo {
    /// The frame before the grasp, in which the tissue lies still.
    pub rest: usize,
    /// The first frame of the lift.
    pub first: usize,
    /// The last frame of the lift.
    pub last: usize,
    /// A pixel (u, v) of the frame `rest` on the organ that is lifted.
    pub click: [f64; 2],
    /// Force with which the instrument lifts the tissue at the top, in the camera's axes (N), if it
    /// was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<[f64; 3]>,
}

impl LiftInfo {
    /// Checks the lift without its recording's frames.
    pub(crate) fn validate(&self, camera: Option<&Camera>) -> Result<(), String> {
        let Self { rest, first, last, click: [u, v], force_n } = *self;
        if let Some(force) = force_n.filter(|f| !f.iter().all(|n| n.abs() <= 100.0)) {
            return Err(format!("force_n is {force:?}; it must have three numbers of at most 100 N"));
        }
        if first < rest {
            return Err(format!("first is {first}; it must not be before rest, which is frame {rest}"));
        }
        if last <= first {
            return Err(format!("last is {last}; it must be after first, which is frame {first}"));
        }
        if !(u.is_finite() && v.is_finite()) {
            return Err("click has a coordinate that is not a finite number".into());
        }
        if let Some(camera) = camera {
            self.validate_click(camera)?;
        }
        Ok(())
    }

    /// Checks that the click is a pixel of the camera.
    pub(crate) fn validate_click(&self, camera: &Camera) -> Result<(), String> {
        let [u, v] = self.click;
        let (w, h) = (camera.width, camera.height);
        let inside = (0.0..=w as f64 - 1.0).contains(&u) && (0.0..=h as f64 - 1.0).contains(&v);
        if inside {
            return Ok(());
        }
        Err(format!("click is [{u}, {v}]; it must be a pixel of the {w} x {h} image"))
    }

    /// Checks that the recording has the frames.
    pub(crate) fn validate_frames(&self, frames: usize) -> Result<(), String> {
        if self.last < frames {
            return Ok(());
        }
        let end = frames.saturating_sub(1);
        Err(format!("last is {}; the recording has the frames 0 to {end}", self.last))
    }

    /// Whether a frame belongs to the lift, its approach included.
    pub fn holds(&self, frame: usize) -> bool {
        (self.rest..=self.last).contains(&frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lift() -> LiftInfo {
        LiftInfo { rest: 5, first: 20, last: 60, click: [100.0, 50.0], force_n: None }
    }

    #[test]
    fn a_lift_in_order_is_accepted() {
        let camera = Camera::centred(200, 100, 1.0);
        assert!(lift().validate(Some(&camera)).is_ok());
        assert!(lift().validate_frames(61).is_ok());
        assert!(lift().holds(5) && lift().holds(60) && !lift().holds(61) && !lift().holds(4));
    }

    #[test]
    fn each_damaged_field_is_named() {
        let camera = Camera::centred(200, 100, 1.0);
        let cases = [
            (LiftInfo { rest: 21, ..lift() }, "first is 20"),
            (LiftInfo { last: 20, ..lift() }, "last is 20"),
            (LiftInfo { click: [f64::NAN, 1.0], ..lift() }, "click has a coordinate"),
            (LiftInfo { click: [200.0, 1.0], ..lift() }, "click is [200, 1]"),
            (LiftInfo { click: [20.0, -1.0], ..lift() }, "click is [20, -1]"),
        ];
        for (lift, expected) in cases {
            let error = lift.validate(Some(&camera)).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
        let error = lift().validate_frames(60).unwrap_err();
        assert_eq!(error, "last is 60; the recording has the frames 0 to 59");
    }
}
