//! The cameras of a scene.

use crate::Frame;
use glam::DQuat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trocar_camera::{Camera, Distortion};
use trocar_core::Pose;

/// One camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CellCamera {
    /// Name; observations have it.
    pub name: String,
    /// Where it looks from and to.
    pub view: View,
    /// What its lens does.
    pub lens: Lens,
    /// Width and height of the image (px); the recording's own if its lens is the recording's.
    #[serde(default = "image_size")]
    pub size_px: [u32; 2],
    /// Width and height of the image that policies get (px).
    #[serde(default = "policy_size")]
    pub policy_size_px: [u32; 2],
    /// For an oblique endoscope: the angle from its shaft to the view (degrees); the shaft points
    /// from the view towards the image's top. 0 for any other camera.
    #[serde(default)]
    pub oblique_deg: f64,
    /// It measures depth, too.
    #[serde(default)]
    pub depth: bool,
}

fn image_size() -> [u32; 2] {
    [1280, 720]
}

fn policy_size() -> [u32; 2] {
    [224, 224]
}

/// Where a camera looks from and to. Its frame is OpenCV's: x right, y down, z forward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum View {
    /// From one point to another.
    LookAt {
        /// Where it is in the cell frame (m).
        eye_m: [f64; 3],
        /// What is in the image's middle (m).
        target_m: [f64; 3],
        /// The image's top is towards this direction.
        up: [f64; 3],
    },
    /// A pose in the cell frame.
    Pose {
        /// Where it is in the cell frame (m).
        position_m: [f64; 3],
        /// Unit quaternion, scalar first.
        rotation_wxyz: [f64; 4],
    },
    /// As the specimen was recorded: the placement is its pose.
    Recording {},
}

impl View {
    /// The pose in the cell frame; `placement` is that of the specimen.
    pub fn pose(&self, placement: &Frame) -> Pose {
        match *self {
            Self::LookAt { eye_m, target_m, up } => Pose::look_at(eye_m.into(), target_m.into(), up.into()),
            Self::Pose { position_m, rotation_wxyz } => Frame { position_m, rotation_wxyz }.pose(),
            Self::Recording {} => placement.pose(),
        }
    }
}

/// What a lens does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Lens {
    /// A pinhole with the principal point in the middle.
    FieldOfView {
        /// What it sees from left to right (degrees).
        width_deg: f64,
        /// What it sees from top to bottom (degrees).
        height_deg: f64,
    },
    /// A calibrated camera with OpenCV's distortion.
    Opencv {
        /// Focal length along x (px).
        fx_px: f64,
        /// Focal length along y (px).
        fy_px: f64,
        /// Principal point, x (px); the middle of the first pixel is 0.
        cx_px: f64,
        /// Principal point, y (px).
        cy_px: f64,
        /// k1 k2 p1 p2 [k3 [k4 k5 k6]]; none if left out.
        #[serde(default)]
        distortion: Vec<f64>,
    },
    /// The specimen's recording camera.
    Recording {},
}

impl CellCamera {
    /// Its model; `recording` is the specimen's camera. `None` where that is asked for and there is
    /// none, or the numbers make no camera, which a checked scene does not have.
    pub fn model(&self, recording: Option<&Camera>) -> Option<Camera> {
        let [width, height] = self.size_px.map(|n| n as usize);
        let camera = match &self.lens {
            Lens::FieldOfView { width_deg, height_deg } => {
                let focal = |pixels: usize, deg: f64| 0.5 * pixels as f64 / libm::tan(0.5 * deg.to_radians());
                let centred = Camera::centred(width, height, width_deg.to_radians());
                Camera { fx: focal(width, *width_deg), fy: focal(height, *height_deg), ..centred }
            }
            Lens::Opencv { fx_px, fy_px, cx_px, cy_px, distortion } => Camera {
                width,
                height,
                fx: *fx_px,
                fy: *fy_px,
                cx: *cx_px,
                cy: *cy_px,
                distortion: Distortion::try_from(distortion.clone()).ok()?,
            },
            Lens::Recording {} => *recording?,
        };
        camera.validate().is_ok().then_some(camera)
    }

    /// Pose of the endoscope's shaft in the cell frame: the view turned back towards the image's
    /// top by the oblique angle, z along the shaft.
    pub fn shaft(&self, placement: &Frame) -> Pose {
        let view = self.view.pose(placement);
        let turn = DQuat::from_rotation_x(self.oblique_deg.to_radians());
        Pose { rotation: view.rotation * turn, translation: view.translation }
    }

    /// The paper's three (section IV-D): endoscope, D405 above the port midpoint, and the recording
    /// camera.
    pub(crate) fn paper() -> Vec<Self> {
        let camera = |name: &str, view: View, lens: Lens| Self {
            name: name.to_owned(),
            view,
            lens,
            size_px: image_size(),
            policy_size_px: policy_size(),
            oblique_deg: 0.0,
            depth: false,
        };
        let endoscope = View::LookAt { eye_m: [0.0, 0.42, 0.115], target_m: [0.0, 0.456, 0.035], up: [0.0, 0.0, 1.0] };
        let above = View::LookAt { eye_m: [0.0, 0.46, 0.45], target_m: [0.0, 0.46, 0.16], up: [0.0, 1.0, 0.0] };
        let d405 = Lens::FieldOfView { width_deg: 87.0, height_deg: 56.489 };
        vec![
            Self {
                oblique_deg: 30.0,
                ..camera("endoscope", endoscope, Lens::FieldOfView { width_deg: 86.2, height_deg: 54.6 })
            },
            Self { size_px: [848, 480], depth: true, ..camera("d405", above, d405) },
            Self { size_px: [848, 480], depth: true, ..camera("recording", View::Recording {}, Lens::Recording {}) },
        ]
    }
}
