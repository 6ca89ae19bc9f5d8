r"""Calibrates a camera from pictures of a ChArUco board, by OpenCV.

    python -m trocar.calibration PICTURES... --squares 11x8 --square-mm 10 --marker-mm 7 \
        -o endoscope.yaml

Scenes and `trocar` commands read the calibration file. It needs `pip install '.[calibration]'`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

try:
    import cv2
except ImportError as why:
    MISSING = (
        f"trocar.calibration needs the extra 'calibration' ({why}); "
        "run pip install '.[calibration]'"
    )
    if __name__ == "__main__":
        sys.exit(f"error: {MISSING}")
    raise ModuleNotFoundError(MISSING, name=why.name) from why

#: Chessboard corners that a picture must show.
MIN_CORNERS = 8
#: Pictures that a calibration needs.
MIN_VIEWS = 5
#: Distortion models and their numbers of coefficients.
MODELS = {"pinhole-5": 5, "pinhole-8": 8, "fisheye": 4}


@dataclass(frozen=True)
class Board:
    """A ChArUco board."""

    #: Number of squares across and down.
    squares: tuple[int, int]
    #: Edge of a square (m).
    square: float
    #: Edge of a marker (m).
    marker: float
    #: OpenCV's name of the dictionary of markers.
    dictionary: str = "DICT_4X4_250"
    #: The pattern of OpenCV before 4.6, which differs for an even number of rows.
    legacy: bool = False

    def opencv(self) -> cv2.aruco.CharucoBoard:
        """The board for OpenCV. ValueError for a board that cannot exist."""
        name = self.dictionary
        number = getattr(cv2.aruco, name, None) if name.startswith("DICT_") else None
        if number is None:
            raise ValueError(
                f"dictionary: OpenCV does not know '{name}'; "
                "it must be a name such as DICT_4X4_50 or DICT_5X5_100"
            )
        size = f"{self.squares[0]}x{self.squares[1]}"
        if min(self.squares) < 2:
            raise ValueError(f"squares: {size} must be at least 2x2")
        if not 0 < self.marker < self.square:
            marker_mm, square_mm = 1e3 * self.marker, 1e3 * self.square
            raise ValueError(f"markers of {marker_mm} mm do not fit into squares of {square_mm} mm")
        dictionary = cv2.aruco.getPredefinedDictionary(number)
        markers, needed = len(dictionary.bytesList), self.squares[0] * self.squares[1] // 2
        if markers < needed:
            raise ValueError(
                f"dictionary: {name} has {markers} markers; {size} squares need {needed}"
            )
        board = cv2.aruco.CharucoBoard(self.squares, self.square, self.marker, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera and the errors of its calibration."""

    #: Width and height (px).
    size: tuple[int, int]
    #: The camera matrix (3, 3): fx, 0, cx; 0, fy, cy; 0, 0, 1 (px).
    matrix: np.ndarray
    #: Distortion coefficients (4, 5 or 8) in OpenCV's order.
    distortion: np.ndarray
    #: One of `MODELS`.
    model: str
    #: Root mean square of the reprojection error over all corners (px).
    rms: float
    #: The same (px) of each used picture, by its index.
    views: dict[int, float]

    def field_of_view(self) -> tuple[float, float]:
        """Horizontal and vertical angle (degrees) of the undistorted picture of this matrix."""
        (width, height), k = self.size, self.matrix

        def angle(edge: float, centre: float, focal: float) -> float:
            sides = np.arctan(centre / focal) + np.arctan((edge - centre) / focal)
            return float(np.degrees(sides))

        horizontal = angle(width, k[0, 2] + 0.5, k[0, 0])
        return horizontal, angle(height, k[1, 2] + 0.5, k[1, 1])

    def write(self, path: str | Path) -> None:
        """Writes an OpenCV calibration file: YAML, or JSON if the name ends in `.json`."""
        path = Path(path)
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        if not storage.isOpened():
            raise OSError(f"{path} cannot be written")
        storage.write("image_width", self.size[0])
        storage.write("image_height", self.size[1])
        storage.write("camera_matrix", self.matrix)
        storage.write("distortion_coefficients", self.distortion.reshape(-1, 1))
        if self.model == "fisheye":
            storage.write("fisheye_model", 1)
        storage.write("avg_reprojection_error", self.rms)
        storage.release()


def calibrate(
    pictures: Iterable[np.ndarray], board: Board, *, model: str = "pinhole-5"
) -> Calibration:
    """Calibrates from pictures of `board`: uint8 (height, width[, 3]), all of one size.

    Pictures with fewer than 8 corners are skipped. ValueError if fewer than 5 are left, or if
    OpenCV cannot estimate a camera from them.
    """
    if model not in MODELS:
        raise ValueError(f"model: '{model}' is unknown; it must be one of {', '.join(MODELS)}")
    charuco = board.opencv()
    detector = cv2.aruco.CharucoDetector(charuco)
    size: tuple[int, int] | None = None
    points, places, used, count = [], [], [], 0
    for index, picture in enumerate(pictures):
        count += 1
        here = (picture.shape[1], picture.shape[0])
        if size is not None and here != size:
            first = f"the first {size[0]}x{size[1]}"
            raise ValueError(
                f"picture {index} is {here[0]}x{here[1]}, {first}; all must have one size"
            )
        size = here
        corners, identities, _, _ = detector.detectBoard(picture)
        if identities is None or len(identities) < MIN_CORNERS:
            continue
        # OpenCV's stub wants a sequence of arrays here; the function takes one array.
        found: Any = corners
        of_board, in_picture = charuco.matchImagePoints(found, identities)
        points.append(np.asarray(of_board, np.float32).reshape(-1, 1, 3))
        places.append(np.asarray(in_picture, np.float32).reshape(-1, 1, 2))
        used.append(index)
    if size is None or len(used) < MIN_VIEWS:
        raise ValueError(
            f"the board was found in {len(used)} of {count} pictures; "
            f"{MIN_VIEWS} are needed with {MIN_CORNERS} corners each; "
            "check its squares, sizes and dictionary"
        )
    try:
        rms, matrix, distortion, turns, shifts = _estimated(points, places, size, model)
    except cv2.error as why:
        raise ValueError(
            f"OpenCV cannot estimate {model} from these {len(used)} pictures: {why.err or why}"
        ) from why
    distortion = np.asarray(distortion).reshape(-1)[: MODELS[model]]
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    views = {}
    for index, of_board, in_picture, turn, shift in zip(used, points, places, turns, shifts):
        corners_3d = of_board.astype(np.float64)
        projected = project(corners_3d, turn, shift, matrix, distortion)[0].reshape(-1, 2)
        squares = np.sum((projected - in_picture.reshape(-1, 2)) ** 2, axis=1)
        views[index] = float(np.sqrt(np.mean(squares)))
    return Calibration(size, np.asarray(matrix), distortion, model, float(rms), views)


def _estimated(
    points: list[np.ndarray], places: list[np.ndarray], size: tuple[int, int], model: str
) -> tuple[Any, ...]:
    """RMS error (px), matrix, distortion, rotations and translations of the boards.

    `cv2.error` if OpenCV finds no camera.
    """
    if model == "fisheye":
        flags = _fisheye_flag("CALIB_RECOMPUTE_EXTRINSIC") | _fisheye_flag("CALIB_FIX_SKEW")
        # OpenCV 5 takes only rows of points, OpenCV 4 takes columns too.
        wide = [
            [p.astype(np.float64).reshape(1, -1, p.shape[-1]) for p in of]
            for of in (points, places)
        ]
        fisheye: Any = cv2.fisheye
        return tuple(fisheye.calibrate(*wide, size, None, None, flags=flags))
    flags = cv2.CALIB_RATIONAL_MODEL if model == "pinhole-8" else 0
    opencv: Any = cv2
    estimate: tuple[Any, ...] = opencv.calibrateCamera(
        points, places, size, None, None, flags=flags
    )
    return estimate


def _fisheye_flag(name: str) -> int:
    """A flag of fisheye calibration, in `cv2.fisheye` until OpenCV 4 and in `cv2` from 5 on."""
    return int(getattr(cv2.fisheye, name) if hasattr(cv2.fisheye, name) else getattr(cv2, name))


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.calibration",
        description="Calibrates a camera from pictures of a ChArUco board.",
    )
    parser.add_argument("pictures", nargs="+", type=Path, help="pictures of the board")
    parser.add_argument(
        "--squares", default="11x8", help="squares across and down (default %(default)s)"
    )
    parser.add_argument("--square-mm", type=float, required=True, help="edge of a square")
    parser.add_argument("--marker-mm", type=float, required=True, help="edge of a marker")
    parser.add_argument(
        "--dictionary", default="DICT_4X4_250", help="OpenCV's name (default %(default)s)"
    )
    parser.add_argument("--legacy", action="store_true", help="the pattern of OpenCV before 4.6")
    parser.add_argument("--model", choices=MODELS, default="pinhole-5")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="calibration file, .yaml or .json"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    try:
        board = Board(
            _squares(options.squares),
            1e-3 * options.square_mm,
            1e-3 * options.marker_mm,
            options.dictionary,
            options.legacy,
        )
        made = calibrate(map(_read, options.pictures), board, model=options.model)
        made.write(options.output)
    # OpenCV also raises SystemError and TypeError for wrong input.
    except (ValueError, OSError, TypeError, SystemError, cv2.error) as why:
        print(f"error: {why}", file=sys.stderr)
        return 1
    wide, high = made.field_of_view()
    used, count = len(made.views), len(options.pictures)
    if options.json:
        result = {
            "model": made.model,
            "rms_px": made.rms,
            "used": used,
            "pictures": count,
            "camera_matrix": made.matrix.tolist(),
            "distortion": made.distortion.tolist(),
            "field_of_view_deg": [wide, high],
        }
        print(json.dumps(result))
        return 0
    worst = max(made.views, key=made.views.__getitem__)
    print(f"{made.model}, {used} of {count} pictures, reprojection error {made.rms:.3f} px RMS")
    print(f"focal lengths {made.matrix[0, 0]:.1f}, {made.matrix[1, 1]:.1f} px")
    print(f"field of view {wide:.1f} x {high:.1f} degrees")
    print(f"worst picture: {options.pictures[worst]} with {made.views[worst]:.3f} px")
    print(f"written: {options.output}")
    return 0


def _squares(text: str) -> tuple[int, int]:
    across, _, down = text.partition("x")
    if not (across.isdecimal() and down.isdecimal()):
        raise ValueError(f"--squares: '{text}' must be squares across and down, such as 11x8")
    return int(across), int(down)


def _read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise ValueError(f"{path} is not a picture that OpenCV reads")
    return picture


if __name__ == "__main__":
    sys.exit(main())
