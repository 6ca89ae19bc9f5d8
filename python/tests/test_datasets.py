"""LeRobot datasets are read back: by pyarrow, and by LeRobot where it is installed."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("av")
pytest.importorskip("h5py")

import pandas as pd
import pyarrow.parquet as pq

from trocar.datasets import LeRobotWriter, _layouts, _stats, _video, lerobot

FEATURES = {
    "observation.state": {"dtype": "float32", "shape": (3,), "names": ["x", "y", "z"]},
    "observation.images.endoscope": {
        "dtype": "video",
        "shape": (64, 96, 3),
        "names": ["height", "width", "channels"],
    },
    "action": {"dtype": "float32", "shape": (2,), "names": None},
}
LENGTHS = [7, 12, 5]


def picture(episode: int, frame: int) -> np.ndarray:
    """A smooth picture whose colours depend on the frame."""
    y, x = np.mgrid[0:64, 0:96]
    return np.stack([x * 2, y * 3, np.full_like(x, 20 * episode + 10 * frame)], -1).astype(np.uint8)


def frames(episode: int):
    for k in range(LENGTHS[episode]):
        yield {
            "observation.state": np.array([episode, k, -k], dtype=np.float32),
            "observation.images.endoscope": picture(episode, k),
            "action": np.array([k, 0.5], dtype=np.float32),
        }


def write(root, version, episodes=range(len(LENGTHS))):
    writer = LeRobotWriter(root, fps=30, features=FEATURES, version=version)
    for episode in episodes:
        for frame in frames(episode):
            writer.add_frame(frame)
        assert writer.save_episode("lift" if episode < 2 else "cut") == episode
    return writer


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_numbers_and_pictures_survive_a_round_trip(tmp_path, version):
    root = tmp_path / "set"
    write(root, version)
    info = json.loads((root / "meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (
        3,
        sum(LENGTHS),
        2,
    )
    table = pd.concat(pd.read_parquet(p) for p in sorted((root / "data").rglob("*.parquet")))
    assert table["index"].tolist() == list(range(sum(LENGTHS)))
    assert table["episode_index"].tolist() == [e for e, n in enumerate(LENGTHS) for _ in range(n)]
    assert table["task_index"].tolist() == [0] * (LENGTHS[0] + LENGTHS[1]) + [1] * LENGTHS[2]
    assert np.stack(table["observation.state"])[LENGTHS[0] + 3].tolist() == [1, 3, -3]
    for episode, length in enumerate(LENGTHS):
        path = sorted((root / "videos").rglob("*.mp4"))[episode]
        decoded = _video.read(path).astype(int)
        assert len(decoded) == length
        for k in range(length):
            error = np.abs(decoded[k] - picture(episode, k).astype(int))
            assert error.mean() < 3.0, (episode, k)


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_a_continued_dataset_equals_one_written_at_once(tmp_path, version):
    write(tmp_path / "whole", version)
    write(tmp_path / "parts", version, [0])
    write(tmp_path / "parts", version, [1, 2])
    whole = sorted(
        p.relative_to(tmp_path / "whole") for p in (tmp_path / "whole").rglob("*") if p.is_file()
    )
    assert whole == sorted(
        p.relative_to(tmp_path / "parts") for p in (tmp_path / "parts").rglob("*") if p.is_file()
    )
    for name in whole:
        if name.suffix == ".parquet":
            assert pq.read_table(tmp_path / "whole" / name).equals(
                pq.read_table(tmp_path / "parts" / name)
            ), name
        elif name.suffix != ".mp4":
            assert (tmp_path / "whole" / name).read_text() == (
                tmp_path / "parts" / name
            ).read_text(), name


class KilledError(Exception):
    """Stands for a kill: nothing after it is executed."""


def same(a, b):
    """Asserts that two datasets have the same files with the same contents."""
    names = sorted(p.relative_to(a) for p in a.rglob("*") if p.is_file())
    assert names == sorted(p.relative_to(b) for p in b.rglob("*") if p.is_file())
    for name in names:
        if name.suffix == ".parquet":
            assert pq.read_table(a / name).equals(pq.read_table(b / name)), name
        else:
            assert (a / name).read_bytes() == (b / name).read_bytes(), name


@pytest.mark.parametrize(("version", "mb"), [("v3.0", 0), ("v3.0", 16), ("v2.1", 16)])
def test_a_kill_between_any_two_files_changes_nothing_after_it_resumes(
    tmp_path, monkeypatch, version, mb
):
    # With 0 every file is full after an episode, so the next one starts new files.
    monkeypatch.setattr(_layouts, "DATA_FILE_MB", mb)
    write(tmp_path / "whole", version)
    replace = os.replace
    for kill in range(100):
        root, left = tmp_path / f"killed-{kill}", [kill]

        def counted(source, target):
            if left[0] == 0:
                raise KilledError
            left[0] -= 1
            replace(source, target)

        monkeypatch.setattr(os, "replace", counted)
        try:
            write(root, version)
            assert kill > 12
            break
        except KilledError:
            pass
        monkeypatch.setattr(os, "replace", replace)
        kept = LeRobotWriter(root, fps=30, features=FEATURES, version=version).episodes
        if kept:
            write(tmp_path / f"short-{kill}", version, range(kept))
            same(tmp_path / f"short-{kill}", root)
        write(root, version, range(kept, len(LENGTHS)))
        same(tmp_path / "whole", root)
    else:
        raise AssertionError("the loop ends when nothing is killed any more")


def test_an_episode_is_written_again_after_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(_layouts, "DATA_FILE_MB", 0)
    write(tmp_path / "whole", "v3.0")
    writer = write(tmp_path / "set", "v3.0", [0])
    for frame in frames(1):
        writer.add_frame(frame)
    write_json, full = lerobot.write_json, [True]

    def once(path, value):
        if path.name == "info.json" and full.pop():
            raise OSError("no space left")
        write_json(path, value)

    monkeypatch.setattr(lerobot, "write_json", once)
    with pytest.raises(OSError, match="no space"):
        writer.save_episode("cut")
    monkeypatch.setattr(lerobot, "write_json", write_json)
    assert writer.save_episode("lift") == 1
    write(tmp_path / "set", "v3.0", [2])
    same(tmp_path / "whole", tmp_path / "set")


def test_the_first_episode_is_written_again_after_an_error(tmp_path, monkeypatch):
    write(tmp_path / "whole", "v3.0", [0])
    write_json = lerobot.write_json
    for failing in range(2):
        root, calls = tmp_path / f"set-{failing}", [0]
        writer = LeRobotWriter(root, fps=30, features=FEATURES, version="v3.0")
        for frame in frames(0):
            writer.add_frame(frame)

        def full(path, value):
            if path.name == "info.json":
                calls[0] += 1
                if calls[0] == failing + 1:
                    raise OSError("no space left")
            write_json(path, value)

        monkeypatch.setattr(lerobot, "write_json", full)
        with pytest.raises(OSError, match="no space"):
            writer.save_episode("lift")
        monkeypatch.setattr(lerobot, "write_json", write_json)
        assert writer.save_episode("lift") == 0
        same(tmp_path / "whole", root)


def test_two_writers_of_a_folder_take_turns(tmp_path, monkeypatch):
    write(tmp_path / "whole", "v3.0")
    one = write(tmp_path / "set", "v3.0", [0])
    write(tmp_path / "set", "v3.0", [1])
    for frame in frames(2):
        one.add_frame(frame)
    # While one saves, another that opens the folder removes nothing and cannot save.
    inside, save = [], lerobot.LeRobotWriter._save

    def watched(self, task):
        monkeypatch.setattr(lerobot.LeRobotWriter, "_save", save)
        (tmp_path / "set/meta/unfinished.partial").write_text("")
        other = LeRobotWriter(tmp_path / "set", fps=30, features=FEATURES, version="v3.0")
        other.add_frame(next(frames(0)))
        assert (tmp_path / "set/meta/unfinished.partial").exists()
        with pytest.raises(RuntimeError, match="another writer"), other._locked(0.0):
            pass
        (tmp_path / "set/meta/unfinished.partial").unlink()
        inside.append(other.episodes)
        return save(self, task)

    monkeypatch.setattr(lerobot.LeRobotWriter, "_save", watched)
    assert one.save_episode("cut") == 2 and inside == [2]
    same(tmp_path / "whole", tmp_path / "set")


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_files_of_a_killed_writer_are_removed(tmp_path, monkeypatch, version):
    monkeypatch.setattr(_layouts, "DATA_FILE_MB", 0)
    write(tmp_path / "whole", version)
    dying = write(tmp_path / "set", version, [0])
    # Opened before the other is killed, once while it holds the lock and once while it does not.
    before = LeRobotWriter(tmp_path / "set", fps=30, features=FEATURES, version=version)
    with dying._locked():
        amid = LeRobotWriter(tmp_path / "set", fps=30, features=FEATURES, version=version)
    for frame in frames(2):
        dying.add_frame(frame)
    write_json = lerobot.write_json

    def die(path, value):
        raise KilledError

    monkeypatch.setattr(lerobot, "write_json", die)
    with pytest.raises(KilledError):
        dying.save_episode("fold")
    monkeypatch.setattr(lerobot, "write_json", write_json)
    for episode, writer, task in [(1, before, "lift"), (2, amid, "cut")]:
        for frame in frames(episode):
            writer.add_frame(frame)
        assert writer.save_episode(task) == episode
    same(tmp_path / "whole", tmp_path / "set")


def test_a_writer_opened_while_another_saves_keeps_its_files(tmp_path):
    write(tmp_path / "whole", "v3.0")
    one = write(tmp_path / "set", "v3.0", [0, 1])
    with one._locked():
        other = LeRobotWriter(tmp_path / "set", fps=30, features=FEATURES, version="v3.0")
    for frame in frames(2):
        other.add_frame(frame)
    assert other.save_episode("cut") == 2
    same(tmp_path / "whole", tmp_path / "set")


def test_wrong_frames_are_named_and_not_kept(tmp_path):
    writer = LeRobotWriter(tmp_path / "set", fps=30, features=FEATURES)
    good = next(frames(0))
    for change, words in [
        ({"action": np.zeros(3, np.float32)}, r"action has shape \(3,\)"),
        ({"action": np.array([np.nan, 0], np.float32)}, "action has a number that is not finite"),
        ({"observation.images.endoscope": np.zeros((64, 96, 3))}, "pictures are uint8"),
        ({"more": 1}, "more unknown"),
    ]:
        with pytest.raises(ValueError, match=words):
            writer.add_frame(good | change)
    with pytest.raises(ValueError, match="action missing"):
        writer.add_frame({k: v for k, v in good.items() if k != "action"})
    with pytest.raises(ValueError, match="no frames"):
        writer.save_episode("lift")
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign/letter.txt").write_text("dear")
    with pytest.raises(FileExistsError, match="not a LeRobot dataset"):
        LeRobotWriter(tmp_path / "foreign", fps=30, features=FEATURES)


def test_merged_statistics_are_those_of_all_frames():
    dice = np.random.default_rng(1)
    a, b = dice.normal(size=(50, 4)), dice.normal(2.0, 3.0, size=(130, 4))
    got, want = (
        _stats.merged(_stats.of_numbers(a), _stats.of_numbers(b)),
        _stats.of_numbers(np.concatenate([a, b])),
    )
    for name in ("min", "max", "mean", "std", "count"):
        np.testing.assert_allclose(got[name], want[name], rtol=1e-12)


def test_lerobot_reads_it(tmp_path):
    pytest.importorskip("lerobot", reason="LeRobot is not installed (it brings PyTorch)")
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    write(tmp_path / "set", "v3.0")
    dataset = LeRobotDataset(
        "trocar/test",
        root=tmp_path / "set",
        video_backend="pyav",
        delta_timestamps={"action": [0, 1 / 30]},
    )
    assert (dataset.num_episodes, dataset.num_frames, dataset.fps) == (3, sum(LENGTHS), 30)
    first = 0
    for episode, length in enumerate(LENGTHS):
        for k in (0, length - 1):
            item = dataset[first + k]
            assert item["observation.state"].tolist() == [episode, k, -k]
            assert item["task"] == ("lift" if episode < 2 else "cut")
            assert item["action"].shape == (2, 2)
            shown = (item["observation.images.endoscope"].numpy().transpose(1, 2, 0) * 255).round()
            assert np.abs(shown - picture(episode, k)).mean() < 3.0
        first += length
    assert dataset.meta.stats["observation.state"]["max"].shape == (3,)


#: Numeric types of features.
NUMBERS = [
    *(["bool", "float16", "float32", "float64"]),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
]


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_each_numeric_type_is_written(tmp_path, version):
    features = {
        dtype: {"dtype": dtype, "shape": (n,)} for dtype in NUMBERS for n in [1 + len(dtype) % 2]
    }
    writer = LeRobotWriter(tmp_path / "set", fps=30, features=features, version=version)
    for k in range(3):
        writer.add_frame({key: np.full(f["shape"], k % 2, key) for key, f in features.items()})
    writer.save_episode("count")
    table = pd.concat(
        pd.read_parquet(p) for p in sorted((tmp_path / "set/data").rglob("*.parquet"))
    )
    for key in NUMBERS:
        assert [np.ravel(value)[0] for value in table[key]] == [0, 1, 0], key


def test_features_that_cannot_be_written_are_refused_at_once(tmp_path):
    for feature, words in [
        ({"dtype": "image", "shape": (64, 96, 3)}, "view has dtype 'image'.* video, "),
        ({"dtype": "string", "shape": (1,)}, "view has dtype 'string'"),
        ({"dtype": "complex64", "shape": (1,)}, "view has dtype 'complex64'"),
        ({"shape": (1,)}, "view has dtype 'None'"),
        ({"dtype": "video", "shape": (64, 96)}, r"view has shape \(64, 96\)"),
        ({"dtype": "video", "shape": (64, 96, 1)}, "view has 1 channels"),
        (
            {"dtype": "video", "shape": (64, 95, 3)},
            "view is 95x64; the edges of a video must be even",
        ),
    ]:
        with pytest.raises(ValueError, match=words):
            LeRobotWriter(tmp_path / "set", fps=30, features={"view": feature})
    for fps in (0, 29.97):
        with pytest.raises(ValueError, match="must be a positive integer"):
            LeRobotWriter(tmp_path / "set", fps=fps, features=FEATURES)
    assert LeRobotWriter(tmp_path / "set", fps=30.0, features=FEATURES).fps == 30
    assert not (tmp_path / "set").exists()


def test_without_fcntl_datasets_are_written(tmp_path):
    # As on Windows, where there is no lock.
    lines = [
        "import sys",
        "sys.modules['fcntl'] = None",
        "from trocar.datasets import LeRobotWriter",
        "features = {'action': {'dtype': 'float32', 'shape': (1,)}}",
        "writer = LeRobotWriter(sys.argv[1], fps=30, features=features)",
        "writer.add_frame({'action': 1.0})",
        "assert writer.save_episode('wait') == 0",
    ]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines), tmp_path / "set"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
