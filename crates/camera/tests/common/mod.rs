//! Calibration files as other programs write them.

/// OpenCV's sample program.
pub const SAMPLE: &str = "%YAML:1.0
---
calibration_time: \"Sat 01 Jan 2000 10:00:00\"
nframes: 30
image_width: 1280
image_height: 720
board_width: 9
square_size: 2.5000000372529030e-02
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 6.8391e+02, 0., 6.395e+02, 0., 6.9745e+02, 3.595e+02, 0.,
       0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -1.2e-01, 3.4e-02, 1.0e-03, -2.0e-04, 0. ]
avg_reprojection_error: 5.8e-01
";

/// ROS's `camera_calibration`.
pub const ROS: &str = "image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0]
distortion_model: equidistant
distortion_coefficients:
  rows: 1
  cols: 4
  data: [0.01, -0.002, 0.0, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
";
