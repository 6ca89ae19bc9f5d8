"""Draws a ChArUco board, and calibrates a camera from its pictures, with OpenCV.

python charuco.py board FOLDER COLUMNS ROWS
    Writes FOLDER/board (uint8): the cells of the board row by row, 0 for black. A square has
    12 x 12 cells, a marker 6 x 6: 4 x 4 bits and a border of one cell.
python charuco.py calibrate FOLDER COLUMNS ROWS SIDE LENS
    Finds the board with squares of SIDE metres in FOLDER/*.png and calibrates the camera. LENS is
    `pinhole` (k1 k2 p1 p2 k3) or `fisheye`. Writes FOLDER/out (float64): number of pictures and
    of corners, RMS (px), fx, fy, cx, cy, coefficients.
"""

import glob
import sys
import cv2
import numpy as np

what, folder, columns, rows = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
side = float(sys.argv[5]) if what == "calibrate" else 12.0
dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
board = cv2.aruco.CharucoBoard((columns, rows), side, 0.5 * side, dictionary)
if what == "board":
    # Cells of 10 pixels, read at their centre.
    picture = board.generateImage((120 * columns, 120 * rows), marginSize=0, borderBits=1)
    cells = picture[5::10, 5::10]
    assert cells.shape == (12 * rows, 12 * columns)
    assert (np.kron(cells, np.ones((10, 10), np.uint8)) == picture).mean() > 0.999, "cells are not ten pixels wide"
    cells.astype(np.uint8).tofile(f"{folder}/board")
    sys.exit()

detector = cv2.aruco.CharucoDetector(board)
objects, images = [], []
for path in sorted(glob.glob(f"{folder}/*.png")):
    grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    corners, ids, _, _ = detector.detectBoard(grey)
    if ids is None or len(ids) < 10:
        continue
    # No lens is as sharp as a pixel. At such sharp edges cornerSubPix is off by 0.08 px, after this
    # blur by 0.04 px (medians over drawn corners at known positions).
    blurred = cv2.GaussianBlur(grey, (0, 0), 1.5)
    corners = np.asarray(corners, np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    corners = cv2.cornerSubPix(blurred, corners.copy(), (5, 5), (-1, -1), criteria)
    points, found = board.matchImagePoints(corners, ids)
    objects.append(points.reshape(1, -1, 3).astype(np.float64))
    images.append(found.reshape(1, -1, 2).astype(np.float64))
height, width = grey.shape
k, d = np.eye(3), np.zeros((4, 1))
if sys.argv[6] == "fisheye":
    # OpenCV 5 has one set of flags; OpenCV 4 has a separate set for the fisheye model.
    names = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_RECOMPUTE_EXTRINSIC") else cv2
    flags = names.CALIB_RECOMPUTE_EXTRINSIC | names.CALIB_FIX_SKEW
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    rms, k, d, _, _ = cv2.fisheye.calibrate(objects, images, (width, height), k, d, flags=flags, criteria=criteria)
else:
    single = [[a.astype(np.float32) for a in of] for of in (objects, images)]
    rms, k, d, _, _ = cv2.calibrateCamera(*single, (width, height), None, None)
used = [len(images), sum(i.shape[1] for i in images), rms, k[0, 0], k[1, 1], k[0, 2], k[1, 2]]
np.concatenate([used, np.ravel(d)]).astype(float).tofile(f"{folder}/out")
