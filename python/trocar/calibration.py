"""Calibrates a camera from pictures of a ChArUco board, by OpenCV, into a file that scenes and `trocar` commands read.

As a command:

    python -m trocar.calibration PICTURES... --squares 11x8 --square-mm 10 --marker-mm 7 -o endoscope.yaml

It needs the optional packages of `pip install .[calibration]`.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterable

import cv2
import numpy as np

#: Chessboard corners that a picture must show to be of use.
MIN_CORNERS = 8
#: Pictures that a calibration needs.
MIN_VIEWS = 5
#: Distortion models by name: coefficients that are estimated.
MODELS = ("pinhole-5", "pinhole-8", "fisheye")


@dataclass(frozen=True)
class Board:
    """A ChArUco board: `squares` across and down, their edge and the markers' [m], OpenCV's name of the dictionary."""

    squares: tuple[int, int]
    square: float
    marker: float
    dictionary: str = "DICT_4X4_250"
    #: Boards made before OpenCV 4.6 with an even number of rows have the pattern of before.
    legacy: bool = False

    def opencv(self) -> cv2.aruco.CharucoBoard:
        """The board as OpenCV knows it."""
        number = (
            getattr(cv2.aruco, self.dictionary, None)
            if self.dictionary.startswith("DICT_")
            else None
        )
        if number is None:
            raise ValueError(
                f"dictionary: OpenCV knows no '{self.dictionary}'; DICT_4X4_50 and DICT_5X5_100 are such names"
            )
        if min(self.squares) < 2:
            raise ValueError(
                f"squares: {self.squares[0]}x{self.squares[1]} make no board; at least 2x2 are needed"
            )
        if not 0 < self.marker < self.square:
            raise ValueError(
                f"markers of {1e3 * self.marker} mm do not fit into squares of {1e3 * self.square} mm"
            )
        dictionary = cv2.aruco.getPredefinedDictionary(number)
        held, needed = len(dictionary.bytesList), self.squares[0] * self.squares[1] // 2
        if held < needed:
            raise ValueError(
                f"dictionary: {self.dictionary} has {held} markers; {self.squares[0]}x{self.squares[1]} squares need {needed}"
            )
        board = cv2.aruco.CharucoBoard(self.squares, self.square, self.marker, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera: what was estimated, and how well it explains the pictures."""

    #: Width and height [px].
    size: tuple[int, int]
    #: fx, 0, cx; 0, fy, cy; 0, 0, 1 [px].
    matrix: np.ndarray
    #: Coefficients in OpenCV's order.
    distortion: np.ndarray
    #: One of `MODELS`.
    model: str
    #: Root mean square of the reprojection error over all corners [px].
    rms: float
    #: The same for each picture that was used, by its index.
    views: dict[int, float]

    def field_of_view(self) -> tuple[float, float]:
        """Horizontal and vertical angle of the undistorted picture of the same matrix [degrees]."""
        (width, height), k = self.size, self.matrix
        return tuple(
            float(np.degrees(np.arctan(centre / focal) + np.arctan((edge - centre) / focal)))
            for edge, centre, focal in (
                (width, k[0, 2] + 0.5, k[0, 0]),
                (height, k[1, 2] + 0.5, k[1, 1]),
            )
        )

    def write(self, path: str | Path) -> None:
        """Writes an OpenCV calibration file: YAML, or JSON where the name ends in `.json`."""
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
    """Calibrates from pictures (height, width[, 3], 8 bits, all of one size) of `board`.

    Pictures with fewer than 8 corners are passed over; with fewer than 5 others this is a `ValueError` that says how many there were.
    So are pictures that OpenCV finds no camera for.
    """
    if model not in MODELS:
        raise ValueError(f"model: '{model}' is unknown; {', '.join(MODELS)} can be estimated")
    charuco = board.opencv()
    detector = cv2.aruco.CharucoDetector(charuco)
    size: tuple[int, int] | None = None
    points, places, used, count = [], [], [], 0
    for index, picture in enumerate(pictures):
        count += 1
        here = (picture.shape[1], picture.shape[0])
        if size is not None and here != size:
            raise ValueError(
                f"picture {index} is {here[0]}x{here[1]}, the first {size[0]}x{size[1]}; all must be of one size"
            )
        size = here
        corners, identities, _, _ = detector.detectBoard(picture)
        if identities is None or len(identities) < MIN_CORNERS:
            continue
        of_board, in_picture = charuco.matchImagePoints(corners, identities)
        points.append(np.asarray(of_board, np.float32).reshape(-1, 1, 3))
        places.append(np.asarray(in_picture, np.float32).reshape(-1, 1, 2))
        used.append(index)
    if size is None or len(used) < MIN_VIEWS:
        raise ValueError(
            f"the board was found in {len(used)} of {count} pictures; {MIN_VIEWS} are needed with {MIN_CORNERS} corners each. "
            "Are its squares, sizes and dictionary right?"
        )
    try:
        rms, matrix, distortion, turns, shifts = _estimated(points, places, size, model)
    except cv2.error as why:
        raise ValueError(
            f"OpenCV cannot estimate {model} from these {len(used)} pictures: {why.err or why}"
        ) from why
    distortion = np.asarray(distortion).reshape(-1)[
        : {"pinhole-5": 5, "pinhole-8": 8, "fisheye": 4}[model]
    ]
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    views = {}
    for index, of_board, in_picture, turn, shift in zip(used, points, places, turns, shifts):
        seen = project(of_board.astype(np.float64), turn, shift, matrix, distortion)[0].reshape(
            -1, 2
        )
        views[index] = float(
            np.sqrt(np.mean(np.sum((seen - in_picture.reshape(-1, 2)) ** 2, axis=1)))
        )
    return Calibration(size, np.asarray(matrix), distortion, model, float(rms), views)


def _estimated(
    points: list[np.ndarray], places: list[np.ndarray], size: tuple[int, int], model: str
) -> tuple[Any, ...]:
    """RMS error [px], matrix, distortion, turns and shifts of the boards; `cv2.error` where OpenCV finds no camera."""
    if model == "fisheye":
        flags = _fisheye_flag("CALIB_RECOMPUTE_EXTRINSIC") | _fisheye_flag("CALIB_FIX_SKEW")
        # OpenCV 5 takes rows of points only, OpenCV 4 columns too.
        wide = [
            [p.astype(np.float64).reshape(1, -1, p.shape[-1]) for p in of]
            for of in (points, places)
        ]
        return cv2.fisheye.calibrate(*wide, size, None, None, flags=flags)
    flags = cv2.CALIB_RATIONAL_MODEL if model == "pinhole-8" else 0
    return cv2.calibrateCamera(points, places, size, None, None, flags=flags)


def _fisheye_flag(name: str) -> int:
    """A flag of fisheye calibration: of `cv2.fisheye` in OpenCV 4, whose numbers are its own, of `cv2` from 5 on."""
    return int(getattr(cv2.fisheye, name) if hasattr(cv2.fisheye, name) else getattr(cv2, name))


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.calibration", description=__doc__.splitlines()[0]
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
    parser.add_argument("--legacy", action="store_true", help="the pattern of before OpenCV 4.6")
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
    # What OpenCV refuses in ways of its own is an error like others, not a traceback.
    except (ValueError, OSError, TypeError, SystemError, cv2.error) as why:
        print(f"error: {why}", file=sys.stderr)
        return 1
    wide, high = made.field_of_view()
    if options.json:
        said = {
            "model": made.model,
            "rms_px": made.rms,
            "used": len(made.views),
            "pictures": len(options.pictures),
        }
        said |= {
            "camera_matrix": made.matrix.tolist(),
            "distortion": made.distortion.tolist(),
            "field_of_view_deg": [wide, high],
        }
        print(json.dumps(said))
    else:
        print(
            f"{made.model}, {len(made.views)} of {len(options.pictures)} pictures, reprojection error {made.rms:.3f} px RMS"
        )
        print(
            f"focal lengths {made.matrix[0, 0]:.1f}, {made.matrix[1, 1]:.1f} px; field of view {wide:.1f} x {high:.1f} degrees"
        )
        worst = max(made.views, key=made.views.__getitem__)
        print(
            f"worst picture: {options.pictures[worst]} with {made.views[worst]:.3f} px; written: {options.output}"
        )
    return 0


def _squares(text: str) -> tuple[int, int]:
    across, _, down = text.partition("x")
    if not (across.isdecimal() and down.isdecimal()):
        raise ValueError(f"--squares: '{text}' is not such as 11x8, squares across and down")
    return int(across), int(down)


def _read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise ValueError(f"{path} is no picture that OpenCV reads")
    return picture


if __name__ == "__main__":
    sys.exit(main())
