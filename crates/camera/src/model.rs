//! The pinhole camera with OpenCV's lens distortion.

use crate::Result;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A pinhole camera; lengths of the image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Image width [px].
    pub width: usize,
    /// Image height [px].
    pub height: usize,
    /// Focal length along x [px].
    pub fx: f64,
    /// Focal length along y [px].
    pub fy: f64,
    /// Principal point, x [px].
    pub cx: f64,
    /// Principal point, y [px].
    pub cy: f64,
    /// Lens distortion; none by default.
    #[serde(default, skip_serializing_if = "Distortion::is_none")]
    pub distortion: Distortion,
}

/// OpenCV's rational distortion, coefficients in its order: k1 k2 p1 p2 k3 k4 k5 k6 (missing ones are 0).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<f64>", into = "Vec<f64>")]
pub struct Distortion(pub [f64; 8]);

impl Distortion {
    /// True when the lens does not distort.
    pub fn is_none(&self) -> bool {
        self.0 == [0.0; 8]
    }
}

impl From<Vec<f64>> for Distortion {
    fn from(v: Vec<f64>) -> Self {
        let mut k = [0.0; 8];
        for (k, v) in k.iter_mut().zip(v) {
            *k = v;
        }
        Self(k)
    }
}

impl From<Distortion> for Vec<f64> {
    fn from(d: Distortion) -> Self {
        d.0.to_vec()
    }
}

impl Camera {
    /// The D405's depth stream at 848x480: 87 x 58 degrees, square pixels, centred.
    pub fn d405() -> Self {
        todo!()
    }

    /// Refuses sizes of zero, focal lengths that are not positive, and numbers that are not finite.
    pub fn validate(&self) -> Result<()> {
        todo!()
    }

    /// Pixel of a point in the camera frame [m]; `None` behind the camera.
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        let _ = p;
        todo!()
    }

    /// Direction (x, y, 1) of the ray through pixel (u, v): multiplied by a depth it is the point in the camera frame.
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        let _ = (u, v);
        todo!()
    }
}
