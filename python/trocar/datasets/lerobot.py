"""LeRobot datasets, v3.0 and v2.1, videos included, without LeRobot itself (which needs PyTorch).

A dataset is a folder. Both layouts hold the same: the numbers of every frame as Parquet, a video a
camera, and under `meta` the features, the length and task of each episode, and statistics.
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from . import _stats, _video
from ._frames import Feature, Frames, check_dtypes, write_json
from ._layouts import CHUNK, V3, V21, Layout
from ._lock import MAX_WAIT_S, locked

VERSIONS = ("v3.0", "v2.1")

#: Exists while an episode is written. A writer that finds it knows that one is unfinished.
UNFINISHED = "meta/unfinished.partial"

#: Columns of every frame besides the features.
INDICES: dict[str, Feature] = {
    "timestamp": {"dtype": "float32", "shape": (1,), "names": None},
    "frame_index": {"dtype": "int64", "shape": (1,), "names": None},
    "episode_index": {"dtype": "int64", "shape": (1,), "names": None},
    "index": {"dtype": "int64", "shape": (1,), "names": None},
    "task_index": {"dtype": "int64", "shape": (1,), "names": None},
}


class LeRobotWriter:
    """Writes a LeRobot dataset, an episode at a time.

    `features` maps names such as `observation.state`, `action` or `observation.images.endoscope` to
    `{"dtype", "shape", "names"}`. A feature with dtype `video` takes uint8 pictures (height, width,
    3), height and width even. Other dtypes are numeric (`float32`, `int64`, `bool`); anything else
    (`image`, `string`) is a ValueError.

    A folder that holds a dataset with the same features is continued. An episode is in the dataset
    once `save_episode` has returned: a process that ends later loses nothing, and the files of an
    unfinished episode are removed when the folder is opened again. Of several writers of a folder
    one saves at a time.

    >>> writer = LeRobotWriter("lifts", fps=30, features=features)
    >>> for frame in episode:
    ...     writer.add_frame(frame)
    >>> writer.save_episode("lift the appendix")
    """

    def __init__(
        self,
        root: str | os.PathLike[str],
        *,
        fps: int,
        features: dict[str, Feature],
        version: str = "v3.0",
        robot_type: str = "trocar-two-arm-cell",
        codec: str = "libx264",
        crf: int = 18,
    ):
        if version not in VERSIONS:
            raise ValueError(f"version: '{version}' is unknown; it must be {' or '.join(VERSIONS)}")
        reserved = INDICES.keys() & features.keys()
        if reserved:
            raise ValueError(
                f"features: {', '.join(sorted(reserved))}: the writer adds these itself"
            )
        slashed = [key for key in features if "/" in key]
        if slashed:
            raise ValueError(
                f"features: '{slashed[0]}' must not have a slash in its name; "
                "LeRobot joins words by dots"
            )
        if fps <= 0 or fps != int(fps):
            raise ValueError(f"fps: {fps} must be a positive integer")
        # Checked before anything is recorded, not only when an episode is saved.
        check_dtypes(features, ("video",))
        for key, feature in features.items():
            if feature["dtype"] == "video":
                _video.check_shape(key, feature["shape"])
        self.root, self.fps, self.version = Path(root), int(fps), version
        self.codec, self.crf = codec, crf
        self.features = {
            key: dict(f, shape=tuple(f["shape"]), names=f.get("names"))
            for key, f in features.items()
        }
        self._frames = Frames(self.features)
        layout: type[Layout] = V3 if version == "v3.0" else V21
        self._layout = layout(self.root)
        self._info: dict[str, Any] = {
            "codebase_version": version,
            "robot_type": robot_type,
            "total_episodes": 0,
            "total_frames": 0,
            "total_tasks": 0,
            "chunks_size": CHUNK,
            "fps": self.fps,
            "splits": {},
            **layout.PATHS,
            "features": self.features | INDICES,
        }
        if not self._video_keys():
            self._info["video_path"] = None
        self._tasks: list[str] = []
        self._stats: dict[str, _stats.Stats] = {}
        #: Whether the folder must be read, and unfinished files removed, before a write.
        self._needs_recovery = False
        if (self.root / "meta/info.json").exists():
            self._read_info()
            # If another writer holds the lock, the first save recovers.
            self._needs_recovery = True
            with contextlib.suppress(RuntimeError), self._locked(0.0):
                self._recover()
                self._needs_recovery = False
        elif any(path.is_file() and path.suffix != ".partial" for path in self.root.rglob("*")):
            raise FileExistsError(
                f"{self.root} is not empty and not a LeRobot dataset (meta/info.json is missing)"
            )

    def _video_keys(self) -> list[str]:
        return [key for key, f in self.features.items() if f["dtype"] == "video"]

    def _locked(self, max_wait_s: float = MAX_WAIT_S) -> contextlib.AbstractContextManager[None]:
        """Locks the folder. Makes it if it is missing."""
        self.root.mkdir(parents=True, exist_ok=True)
        return locked(self.root, max_wait_s)

    def _read_info(self) -> None:
        """Reads `info.json` of an existing dataset. Changes nothing."""
        info = json.loads((self.root / "meta/info.json").read_text())
        if info.get("codebase_version") != self.version:
            raise ValueError(
                f"{self.root} is a dataset of version {info.get('codebase_version')}, "
                f"not {self.version}"
            )

        def kinds(features: dict[str, Feature]) -> dict[str, tuple[str, tuple[int, ...]]]:
            return {key: (f["dtype"], tuple(f["shape"])) for key, f in features.items()}

        if kinds(info["features"]) != kinds(self._info["features"]) or info["fps"] != self.fps:
            raise ValueError(
                f"{self.root} has other features or another rate; choose another folder"
            )
        self._info = info

    def _recover(self) -> None:
        """Reads an existing dataset and removes the files of an unfinished episode."""
        self._read_info()
        info = self._info
        # `info.json` is written last. Anything beyond it is of an unfinished episode.
        for path in self.root.rglob("*.partial"):
            path.unlink()
        for key in self._video_keys():
            self._layout.video_path(key, self.episodes).unlink(missing_ok=True)
        self._layout.remove_from(self.episodes, info["total_frames"])
        tasks = self._layout.read_tasks()
        self._tasks = tasks[: info["total_tasks"]]
        if len(tasks) > len(self._tasks):
            self._layout.write_tasks(self._tasks)
        self._stats = self._layout.read_stats(self.episodes, info["total_frames"])

    @property
    def episodes(self) -> int:
        """Number of episodes in the dataset."""
        episodes: int = self._info["total_episodes"]
        return episodes

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Adds a frame to the current episode: a value for every feature.

        A wrong one is a ValueError that names the feature, and nothing is added.
        """
        self._frames.add(frame)

    def discard_episode(self) -> None:
        """Removes the frames of the current episode."""
        self._frames.clear()

    def save_episode(self, task: str) -> int:
        """Writes the current episode with its `task` in words, and returns its index.

        ValueError without frames. After an OSError (a full disk) the frames are kept, so that the
        caller can try again.
        """
        if len(self._frames) == 0:
            raise ValueError("the episode has no frames")
        with self._locked():
            return self._save(task)

    def _save(self, task: str) -> int:
        info_path, mark = self.root / "meta/info.json", self.root / UNFINISHED
        if info_path.exists() and (
            self._needs_recovery
            or mark.exists()
            or json.loads(info_path.read_text())["total_episodes"] != self.episodes
        ):
            self._recover()
        length, episode = len(self._frames), self.episodes
        if episode == 0:
            # From now on the folder is a dataset, even if this save fails.
            write_json(info_path, self._info)
        self._needs_recovery = True
        mark.touch()
        if task not in self._tasks:
            self._tasks.append(task)
        columns = self._frames.columns
        first = self._info["total_frames"]
        indices = {
            "timestamp": np.arange(length, dtype=np.float32) / np.float32(self.fps),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, episode),
            "index": np.arange(first, first + length),
            "task_index": np.full(length, self._tasks.index(task)),
        }
        videos, stats, arrays = {}, {}, {}
        for key, feature in self.features.items():
            if feature["dtype"] == "video":
                path = self._layout.video_path(key, episode)
                video_info = _video.write(
                    path, columns[key], self.fps, codec=self.codec, crf=self.crf
                )
                self._info["features"][key].setdefault("info", video_info)
                stats[key] = _stats.of_pictures(columns[key])
                videos[key] = length / self.fps
            else:
                arrays[key] = np.stack(columns[key])
                stats[key] = _stats.of_numbers(arrays[key])
        for key, values in indices.items():
            stats[key] = _stats.of_numbers(values)
        table = pa.table(
            {key: _column(values, self.features[key]) for key, values in arrays.items()}
            | {
                key: pa.array(values, pa.type_for_alias(INDICES[key]["dtype"]))
                for key, values in indices.items()
            }
        )
        row = {"episode_index": episode, "tasks": [task], "length": length}
        self._layout.write_episode(table, row, stats, videos, first)
        self._layout.write_tasks(self._tasks)
        self._stats = {
            key: _stats.merged(self._stats[key], s) if key in self._stats else s
            for key, s in stats.items()
        }
        self._layout.write_stats(self._stats)
        # Written last: an episode is in the dataset when `info.json` counts it.
        self._info["total_episodes"] = episode + 1
        self._info["total_frames"] = first + length
        self._info["total_tasks"] = len(self._tasks)
        self._info["splits"] = {"train": f"0:{episode + 1}"}
        if self.version == "v2.1":
            self._info["total_videos"] = (episode + 1) * len(videos)
            self._info["total_chunks"] = episode // CHUNK + 1
        write_json(info_path, self._info)
        self._frames.clear()
        mark.unlink(missing_ok=True)
        self._needs_recovery = False
        return episode


def _column(values: np.ndarray, feature: Feature) -> pa.Array:
    """Values (frames, ...) as a Parquet column: numbers for shape (1,), lists otherwise."""
    kind = pa.type_for_alias(feature["dtype"])
    if feature["shape"] == (1,):
        return pa.array(values.reshape(-1), kind)
    column: pa.Array = pa.array(values.reshape(-1), kind)
    for size in reversed(feature["shape"]):
        column = (
            pa.FixedSizeListArray.from_arrays(column, size)
            if len(feature["shape"]) == 1
            else _list(column, size)
        )
    return column


def _list(values: pa.Array, size: int) -> pa.Array:
    return pa.ListArray.from_arrays(np.arange(0, len(values) + 1, size, dtype=np.int32), values)
