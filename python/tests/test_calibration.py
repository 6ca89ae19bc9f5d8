"""Calibration finds the camera that pictures of a board were rendered with."""

import functools

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from trocar.calibration import MODELS, Board, calibrate, main

BOARD = Board((9, 6), 10e-3, 7e-3, "DICT_4X4_100")
MATRIX = np.array([[600.0, 0, 325.0], [0, 605.0, 238.0], [0, 0, 1]])
PINHOLE = np.array([-0.20, 0.06, 0.001, -0.0005, 0.0])
SIZE = (640, 480)


#: A lens for each distortion model.
LENSES = {
    "pinhole-5": PINHOLE,
    "pinhole-8": np.array([0.10, -0.05, 0.001, -0.0005, 0.01, 0.30, 0.02, 0.0]),
    "fisheye": np.array([-0.05, 0.02, -0.004, 0.0]),
}


def undistorted(pixels, distortion, model):
    """Rays (x, y) at z = 1 of pixels (n, 1, 2) through a lens."""
    if model == "fisheye":
        return cv2.fisheye.undistortPoints(pixels, MATRIX, distortion).reshape(-1, 2)
    until = (3, 40, 1e-10)
    if hasattr(cv2, "undistortPointsIter"):
        return cv2.undistortPointsIter(pixels, MATRIX, distortion, None, None, until).reshape(-1, 2)
    return cv2.undistortPoints(pixels, MATRIX, distortion, criteria=until).reshape(-1, 2)


@functools.cache
def drawn(model, fine, views=12):
    """Pictures of the board through a distorted lens, rendered at `fine` times the size."""
    flat = BOARD.opencv().generateImage((1800, 1200), marginSize=0)
    scale = 1800 / (9 * BOARD.square)
    dice = np.random.default_rng(3)
    y, x = np.mgrid[0 : SIZE[1] * fine, 0 : SIZE[0] * fine]
    pixels = (
        np.stack([(x + 0.5) / fine - 0.5, (y + 0.5) / fine - 0.5], -1)
        .reshape(-1, 1, 2)
        .astype(np.float64)
    )
    rays = undistorted(pixels, LENSES[model], model)
    rays = np.concatenate([rays, np.ones((len(rays), 1))], 1)
    pictures = []
    for _ in range(views):
        turn = cv2.Rodrigues(dice.uniform([-0.5, -0.5, -0.3], [0.5, 0.5, 0.3]))[0]
        centre = np.array(
            [dice.uniform(-0.02, 0.02), dice.uniform(-0.015, 0.015), dice.uniform(0.09, 0.15)]
        )
        shift = centre - turn @ np.array([4.5, 3, 0]) * BOARD.square
        normal = turn[:, 2]
        hit = rays * ((normal @ shift) / (rays @ normal))[:, None]
        on_board = (hit - shift) @ turn[:, :2] * scale - 0.5
        maps = on_board.reshape(SIZE[1] * fine, SIZE[0] * fine, 2).astype(np.float32)
        big = cv2.remap(flat, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=255)
        pictures.append(cv2.resize(big, SIZE, interpolation=cv2.INTER_AREA))
    return pictures


def test_a_rendered_board_gives_its_lens(tmp_path):
    pictures = drawn("pinhole-5", 3)
    made = calibrate(pictures, BOARD)
    assert made.rms < 0.1 and len(made.views) >= 10
    np.testing.assert_allclose(np.diag(made.matrix)[:2], [600, 605], rtol=2e-3)
    np.testing.assert_allclose(made.matrix[:2, 2], [325, 238], atol=1.0)
    assert abs(made.distortion[0] - PINHOLE[0]) < 0.01
    # The command writes a file that OpenCV reads.
    names = []
    for k, picture in enumerate(pictures):
        names.append(str(tmp_path / f"{k}.png"))
        cv2.imwrite(names[-1], picture)
    for name in ("camera.yaml", "camera.json"):
        arguments = [
            *names,
            "--squares",
            "9x6",
            "--square-mm",
            "10",
            "--marker-mm",
            "7",
            "--dictionary",
            "DICT_4X4_100",
        ]
        assert main([*arguments, "-o", str(tmp_path / name), "--json"]) == 0
        storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_READ)
        np.testing.assert_allclose(storage.getNode("camera_matrix").mat(), made.matrix, rtol=1e-5)
        assert int(storage.getNode("image_width").real()) == 640


@pytest.mark.parametrize("model", MODELS)
def test_each_model_gives_its_lens(model):
    lens = LENSES[model]
    made = calibrate(drawn(model, 2), BOARD, model=model)
    assert made.model == model and made.rms < 0.15 and len(made.views) >= 10
    assert made.distortion.shape == ({"pinhole-5": 5, "pinhole-8": 8, "fisheye": 4}[model],)
    # Coefficients are not unique, so the directions of rays are compared.
    x, y = np.meshgrid(np.linspace(60, 580, 9), np.linspace(50, 430, 7))
    pixels = np.stack([x, y], -1).reshape(-1, 1, 2)
    rays = undistorted(pixels, lens, model)
    rays = np.concatenate([rays, np.ones((len(rays), 1))], 1).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    seen = project(rays, np.zeros(3), np.zeros(3), made.matrix, made.distortion)[0]
    assert np.abs(seen.reshape(-1, 2) - pixels.reshape(-1, 2)).max() < 1.5


def test_errors_of_opencv_are_one_line(tmp_path, capsys, monkeypatch):
    many = [str(tmp_path / f"{k}.png") for k in range(6)]
    for name, picture in zip(many, drawn("pinhole-5", 2)):
        cv2.imwrite(name, picture)
    common = [
        "--squares",
        "9x6",
        "--dictionary",
        "DICT_4X4_100",
        "--square-mm",
        "10",
        "--marker-mm",
        "7",
        "-o",
        str(tmp_path / "c.yaml"),
    ]
    for more, words in [
        (["--squares", "1x1"], "1x1 must be at least 2x2"),
        (["--squares", "9"], "'9' must be squares across and down, such as 11x8"),
        (["--squares", "60x60"], "DICT_4X4_100 has 100 markers"),
        (["--dictionary", "Board"], "does not know 'Board'"),
    ]:
        assert main([*many, *common, *more]) == 1
        assert words in capsys.readouterr().err
    for error in (cv2.error, SystemError, TypeError):

        def fail(*given, **named):
            raise error("OpenCV's own words")

        monkeypatch.setattr(cv2, "calibrateCamera", fail)
        assert main([*many, *common]) == 1
        assert "OpenCV's own words" in capsys.readouterr().err
    assert not (tmp_path / "c.yaml").exists()


def test_wrong_pictures_are_refused(tmp_path, capsys):
    blank = [np.full((480, 640), 200, np.uint8)] * 6
    with pytest.raises(ValueError, match="found in 0 of 6 pictures"):
        calibrate(blank, BOARD)
    with pytest.raises(ValueError, match="all must have one size"):
        calibrate([blank[0], np.zeros((10, 10), np.uint8)], BOARD)
    with pytest.raises(ValueError, match="do not fit"):
        calibrate(blank, Board((9, 6), 7e-3, 10e-3))
    with pytest.raises(ValueError, match="does not know 'DICT'"):
        calibrate(blank, Board((9, 6), 10e-3, 7e-3, "DICT"))
    arguments = [
        str(tmp_path / "none.png"),
        "--square-mm",
        "10",
        "--marker-mm",
        "7",
        "-o",
        str(tmp_path / "c.yaml"),
    ]
    assert main(arguments) == 1
    assert "none.png is not a picture" in capsys.readouterr().err
    assert not (tmp_path / "c.yaml").exists()
