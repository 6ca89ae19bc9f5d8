//! Calibration files of OpenCV (samples and `FileStorage`, YAML or JSON) and ROS
//! (`camera_calibration`, YAML).

use crate::{Camera, CameraModel, Distortion, Error, Fisheye, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Maximum file size. A calibration is about a page of text; larger files are rejected unread.
const MAX_BYTES: u64 = 1 << 20;

/// A matrix as OpenCV and ROS write it.
#[derive(Debug, Serialize, Deserialize)]
struct Matrix {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    type_id: Option<String>,
    rows: usize,
    cols: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dt: Option<String>,
    data: Vec<f64>,
}

/// The keys that are used. Others (board, views, errors) are ignored.
#[derive(Debug, Serialize, Deserialize)]
struct File {
    #[serde(alias = "imageWidth", alias = "width")]
    image_width: usize,
    #[serde(alias = "imageHeight", alias = "height")]
    image_height: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion_model: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fisheye_model: Option<i64>,
    #[serde(alias = "cameraMatrix", alias = "K")]
    camera_matrix: Matrix,
    #[serde(alias = "distortionCoefficients", alias = "distCoeffs", alias = "dist_coeffs", alias = "D")]
    distortion_coefficients: Matrix,
}

impl CameraModel {
    /// Reads a calibration file: JSON if it begins with a brace, otherwise YAML (including OpenCV's
    /// `%YAML:1.0`). The model is fisheye if `fisheye_model` is not 0 or `distortion_model` is
    /// `fisheye` or `equidistant`.
    ///
    /// # Errors
    /// One line with the file and the reason.
    pub fn read_calibration(path: &Path) -> Result<Self> {
        let wrong = |reason: String| Error::Calibration { path: path.to_owned(), reason };
        let size = std::fs::metadata(path).map_err(|e| wrong(e.to_string()))?.len();
        if size > MAX_BYTES {
            return Err(wrong(format!("the file has {size} bytes; a calibration has at most {MAX_BYTES}")));
        }
        let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
        Self::parse_calibration(&bytes).map_err(wrong)
    }

    /// Parses the content of a calibration file, see [`Self::read_calibration`].
    ///
    /// # Errors
    /// One line with the reason.
    ///
    /// ```
    /// use trocar_camera::CameraModel;
    ///
    /// let model = CameraModel::parse_calibration(b"
    /// image_width: 640
    /// image_height: 480
    /// camera_matrix: {rows: 3, cols: 3, data: [600.0, 0, 319.5, 0, 600.0, 239.5, 0, 0, 1]}
    /// distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}
    /// ")?;
    /// assert_eq!(model.camera().fx, 600.0);
    /// # Ok::<(), String>(())
    /// ```
    pub fn parse_calibration(bytes: &[u8]) -> std::result::Result<Self, String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "the file is not UTF-8 text".to_owned())?;
        let text = text.trim_start_matches('\u{feff}').trim_start();
        let file: File = if text.starts_with('{') {
            serde_json::from_str(text).map_err(|e| format!("not an OpenCV calibration: {e}"))?
        } else {
            // OpenCV's first line (`%YAML:1.0`) is not a valid YAML directive.
            let body = match text.split_once('\n') {
                Some((first, rest)) if first.starts_with("%YAML") => rest,
                _ => text,
            };
            serde_saphyr::from_str(body).map_err(|e| {
                let message = e.to_string();
                let first = message.lines().next().unwrap_or_default();
                format!("not an OpenCV calibration: {}", first.trim_start_matches("error: "))
            })?
        };
        file.model()
    }

    /// Writes a calibration for OpenCV's `FileStorage`: JSON if the name ends in `.json`, otherwise
    /// YAML.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_calibration(&self, path: &Path) -> Result<()> {
        let wrong = |reason: String| Error::Calibration { path: path.to_owned(), reason };
        let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let file = File::of(self);
        let text = if json {
            serde_json::to_string_pretty(&file).map_err(|e| wrong(e.to_string()))? + "\n"
        } else {
            file.yaml()
        };
        std::fs::write(path, text).map_err(|e| wrong(e.to_string()))
    }
}

impl File {
    fn of(model: &CameraModel) -> Self {
        let camera = model.camera();
        let matrix = |rows: usize, data: Vec<f64>| Matrix {
            type_id: Some("opencv-matrix".into()),
            rows,
            cols: data.len() / rows,
            dt: Some("d".into()),
            data,
        };
        let (name, fisheye, lens) = match model {
            CameraModel::Fisheye(_, Fisheye(k)) => ("equidistant", 1, k.to_vec()),
            CameraModel::Pinhole(Camera { distortion: Distortion(k), .. }) => {
                let rational = k[5..].iter().any(|k| *k != 0.0);
                let name = if rational { "rational_polynomial" } else { "plumb_bob" };
                (name, 0, k[..if rational { 8 } else { 5 }].to_vec())
            }
        };
        let whole = vec![camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0];
        Self {
            image_width: camera.width,
            image_height: camera.height,
            distortion_model: Some(name.into()),
            fisheye_model: Some(fisheye),
            camera_matrix: matrix(3, whole),
            distortion_coefficients: matrix(1, lens),
        }
    }

    fn yaml(&self) -> String {
        let matrix = |name: &str, m: &Matrix| {
            let data: Vec<String> = m.data.iter().map(|x| format!("{x:?}")).collect();
            let data = data.join(", ");
            format!(
                "{name}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {data} ]\n",
                m.rows, m.cols
            )
        };
        format!(
            "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\ndistortion_model: {}\nfisheye_model: {}\n{}{}",
            self.image_width,
            self.image_height,
            self.distortion_model.as_deref().unwrap_or("plumb_bob"),
            self.fisheye_model.unwrap_or(0),
            matrix("camera_matrix", &self.camera_matrix),
            matrix("distortion_coefficients", &self.distortion_coefficients)
        )
    }

    fn model(self) -> std::result::Result<CameraModel, String> {
        for (name, m) in
            [("camera_matrix", &self.camera_matrix), ("distortion_coefficients", &self.distortion_coefficients)]
        {
            if m.rows.checked_mul(m.cols) != Some(m.data.len()) {
                return Err(format!("{name} is {} x {}, but has {} numbers", m.rows, m.cols, m.data.len()));
            }
        }
        let &[fx, skew, cx, below, fy, cy, a, b, one] = self.camera_matrix.data.as_slice() else {
            return Err(format!("camera_matrix has {} numbers; it must have 3 x 3", self.camera_matrix.data.len()));
        };
        if [skew, below, a, b] != [0.0; 4] || one != 1.0 {
            return Err("camera_matrix must be [fx 0 cx; 0 fy cy; 0 0 1]; skewed pixels are not supported".into());
        }
        let k = self.distortion_coefficients.data;
        let named = match self.distortion_model.as_deref() {
            None => None,
            Some("plumb_bob" | "rational_polynomial") => Some(false),
            Some("equidistant" | "fisheye") => Some(true),
            Some(other) => {
                let known = "plumb_bob, rational_polynomial, equidistant";
                return Err(format!("distortion_model is '{other}'; it must be one of {known}"));
            }
        };
        let fisheye = named.unwrap_or(false) || self.fisheye_model.is_some_and(|flag| flag != 0);
        let camera =
            |distortion| Camera { width: self.image_width, height: self.image_height, fx, fy, cx, cy, distortion };
        let model = if fisheye {
            let k: [f64; 4] = k.try_into().map_err(|k: Vec<f64>| {
                format!("distortion_coefficients has {} numbers; a fisheye lens must have 4 (k1 k2 k3 k4)", k.len())
            })?;
            CameraModel::Fisheye(camera(Distortion::default()), Fisheye(k))
        } else {
            if k.iter().skip(8).any(|k| *k != 0.0) {
                return Err(format!(
                    "distortion_coefficients has {} numbers; thin prisms and tilted sensors (more than 8) are not supported",
                    k.len()
                ));
            }
            let known: Vec<f64> = k.into_iter().take(8).collect();
            CameraModel::Pinhole(camera(Distortion::try_from(known)?))
        };
        model.validate().map_err(|e| e.to_string())?;
        Ok(model)
    }
}
