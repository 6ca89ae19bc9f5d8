"""Results of OpenCV for a calibration file: python opencv.py FOLDER.

Reads FOLDER/points (float64 x y z), FOLDER/pixels (float64 u v) and FOLDER/calibration.yml, written by
the test. Writes FOLDER/projected, FOLDER/undistorted (x, y at z = 1), FOLDER/map (u, v of every pixel
of an undistorted picture with the camera matrix FOLDER/plain), FOLDER/back.yml and FOLDER/back.json.
"""

import sys
import cv2
import numpy as np

folder = sys.argv[1]
read = lambda name, n: np.fromfile(f"{folder}/{name}").reshape(-1, 1, n)
storage = cv2.FileStorage(f"{folder}/calibration.yml", cv2.FILE_STORAGE_READ)
k, d = storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat()
size = tuple(int(storage.getNode(f"image_{side}").real()) for side in ("width", "height"))
fisheye = storage.getNode("fisheye_model").real() != 0
plain = np.fromfile(f"{folder}/plain").reshape(3, 3)
points, pixels = read("points", 3), read("pixels", 2)
zero, exact = np.zeros(3), (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
if fisheye:
    lens = d.reshape(4, 1)
    projected = cv2.fisheye.projectPoints(points, zero, zero, k, lens)[0]
    undistorted = cv2.fisheye.undistortPoints(pixels, k, lens, criteria=exact)
    maps = cv2.fisheye.initUndistortRectifyMap(k, lens, np.eye(3), plain, size, cv2.CV_32FC1)
else:
    projected = cv2.projectPoints(points, zero, zero, k, d)[0]
    undistorted = cv2.undistortPoints(pixels, k, d, criteria=exact)
    maps = cv2.initUndistortRectifyMap(k, d, np.eye(3), plain, size, cv2.CV_32FC1)
projected.astype(float).tofile(f"{folder}/projected")
undistorted.astype(float).tofile(f"{folder}/undistorted")
np.dstack(maps[:2]).astype(float).tofile(f"{folder}/map")
for ending in ("yml", "json"):
    out = cv2.FileStorage(f"{folder}/back.{ending}", cv2.FILE_STORAGE_WRITE)
    for name, value in (("image_width", size[0]), ("image_height", size[1]), ("fisheye_model", int(fisheye))):
        out.write(name, value)
    out.write("calibration_time", "Sat 01 Jan 2000 10:00:00")
    out.write("camera_matrix", k)
    out.write("distortion_coefficients", d)
    out.release()
