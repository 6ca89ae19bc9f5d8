"""LeRobot datasets, v3.0 and v2.1, videos included, without LeRobot itself (which brings PyTorch).

A dataset is a folder. Both layouts hold the same: numbers of every frame as Parquet, a video per camera, and under `meta` what the
features are, how long each episode is, what was asked for in it, and statistics.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from . import _stats, _video
from ._frames import Feature, Frames, replace, write_json

VERSIONS = ("v3.0", "v2.1")

#: Files in a folder ("chunk"), at most.
CHUNK = 1000
#: Size of a data file from which on a new one begins [MB]. It is written again with every episode, so it is less than LeRobot's 100.
DATA_FILE_MB = 16

#: What every frame has besides the features.
INDICES: dict[str, Feature] = {
    "timestamp": {"dtype": "float32", "shape": (1,), "names": None},
    "frame_index": {"dtype": "int64", "shape": (1,), "names": None},
    "episode_index": {"dtype": "int64", "shape": (1,), "names": None},
    "index": {"dtype": "int64", "shape": (1,), "names": None},
    "task_index": {"dtype": "int64", "shape": (1,), "names": None},
}


class LeRobotWriter:
    """Writes a LeRobot dataset, an episode at a time.

    `features` maps names such as `observation.state`, `action` or `observation.images.endoscope` to `{"dtype", "shape", "names"}`;
    a feature with dtype `video` takes 8-bit pictures (height, width, 3). A folder with the same features is gone on with. An episode
    is in the dataset once `save_episode` has returned: a process that dies later takes nothing back.

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
            raise ValueError(f"version: '{version}' is unknown; {' and '.join(VERSIONS)} can be written")
        reserved = INDICES.keys() & features.keys()
        if reserved:
            raise ValueError(f"features: {', '.join(sorted(reserved))} are written by themselves")
        slashed = [key for key in features if "/" in key]
        if slashed:
            raise ValueError(f"features: '{slashed[0]}' has a slash in its name; LeRobot joins words by dots")
        self.root, self.fps, self.version = Path(root), fps, version
        self.codec, self.crf = codec, crf
        self.features = {key: dict(f, shape=tuple(f["shape"]), names=f.get("names")) for key, f in features.items()}
        self._frames = Frames(self.features)
        layout = _V3 if version == "v3.0" else _V21
        self._layout = layout(self.root)
        self._info = {
            "codebase_version": version,
            "robot_type": robot_type,
            "total_episodes": 0,
            "total_frames": 0,
            "total_tasks": 0,
            "chunks_size": CHUNK,
            "fps": fps,
            "splits": {},
            **layout.PATHS,
            "features": self.features | INDICES,
        }
        if not self._video_keys():
            self._info["video_path"] = None
        self._tasks: list[str] = []
        self._stats: dict[str, _stats.Stats] = {}
        if (self.root / "meta/info.json").exists():
            self._go_on()
        elif self.root.exists() and any(self.root.iterdir()):
            raise FileExistsError(f"{self.root} is not empty and is no LeRobot dataset (meta/info.json is missing)")

    def _video_keys(self) -> list[str]:
        return [key for key, f in self.features.items() if f["dtype"] == "video"]

    def _go_on(self) -> None:
        """Takes up what a dataset already holds."""
        info = json.loads((self.root / "meta/info.json").read_text())
        if info.get("codebase_version") != self.version:
            raise ValueError(f"{self.root} is a dataset of version {info.get('codebase_version')}, not {self.version}")

        def meant(features: dict[str, Feature]) -> dict[str, tuple[str, tuple[int, ...]]]:
            return {key: (f["dtype"], tuple(f["shape"])) for key, f in features.items()}

        if meant(info["features"]) != meant(self._info["features"]) or info["fps"] != self.fps:
            raise ValueError(f"{self.root} has other features or another rate; write into another folder")
        self._info = info
        self._tasks = self._layout.read_tasks()
        self._stats = _stats.from_plain(self._layout.read_stats())

    @property
    def episodes(self) -> int:
        """Episodes in the dataset."""
        return self._info["total_episodes"]

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Takes a frame of the episode under way: a value for every feature. A wrong one is named, and nothing of it is kept."""
        self._frames.add(frame)

    def discard_episode(self) -> None:
        """Forgets the episode under way."""
        self._frames.clear()

    def save_episode(self, task: str) -> int:
        """Writes the episode under way, in which `task` was asked for, and returns its index. An episode without frames is an error."""
        length, episode = len(self._frames), self.episodes
        if length == 0:
            raise ValueError("the episode has no frames")
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
                said = _video.write(path, columns[key], self.fps, codec=self.codec, crf=self.crf)
                self._info["features"][key].setdefault("info", said)
                stats[key] = _stats.of_pictures(columns[key])
                videos[key] = length / self.fps
            else:
                arrays[key] = np.stack(columns[key])
                stats[key] = _stats.of_numbers(arrays[key])
        for key, values in indices.items():
            stats[key] = _stats.of_numbers(values)
        table = pa.table(
            {key: _column(values, self.features[key]) for key, values in arrays.items()}
            | {key: pa.array(values, pa.type_for_alias(INDICES[key]["dtype"])) for key, values in indices.items()}
        )
        row = {"episode_index": episode, "tasks": [task], "length": length}
        self._layout.write_episode(table, row, stats, videos, first)
        self._layout.write_tasks(self._tasks)
        self._stats = {key: _stats.merged(self._stats[key], s) if key in self._stats else s for key, s in stats.items()}
        if self.version == "v3.0":
            write_json(self.root / "meta/stats.json", _stats.plain(self._stats))
        # What counts is written last: an episode is in the dataset when `info` says so.
        self._info["total_episodes"] = episode + 1
        self._info["total_frames"] = first + length
        self._info["total_tasks"] = len(self._tasks)
        self._info["splits"] = {"train": f"0:{episode + 1}"}
        if self.version == "v2.1":
            self._info["total_videos"] = (episode + 1) * len(videos)
            self._info["total_chunks"] = episode // CHUNK + 1
        write_json(self.root / "meta/info.json", self._info)
        self._frames.clear()
        return episode


def _column(values: np.ndarray, feature: Feature) -> pa.Array:
    """Values (frames, ...) as a Parquet column: plain numbers for shape (1,), lists of fixed length otherwise."""
    kind = pa.type_for_alias(feature["dtype"])
    if feature["shape"] == (1,):
        return pa.array(values.reshape(-1), kind)
    column: pa.Array = pa.array(values.reshape(-1), kind)
    for size in reversed(feature["shape"]):
        column = pa.FixedSizeListArray.from_arrays(column, size) if len(feature["shape"]) == 1 else _list(column, size)
    return column


def _list(values: pa.Array, size: int) -> pa.Array:
    return pa.ListArray.from_arrays(np.arange(0, len(values) + 1, size, dtype=np.int32), values)


class _V3:
    """Version 3.0: episodes share data files; what is known of each is a row of `meta/episodes`. Here each episode has videos of its own."""

    PATHS = {
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": 200,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
    }
    EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

    def __init__(self, root: Path):
        self.root = root

    def video_path(self, key: str, episode: int) -> Path:
        chunk, file = divmod(episode, CHUNK)
        return self.root / self.PATHS["video_path"].format(video_key=key, chunk_index=chunk, file_index=file)

    def read_tasks(self) -> list[str]:
        return list(pd.read_parquet(self.root / "meta/tasks.parquet").index)

    def read_stats(self) -> dict[str, Any]:
        return json.loads((self.root / "meta/stats.json").read_text())

    def write_tasks(self, tasks: list[str]) -> None:
        table = pd.DataFrame({"task_index": range(len(tasks))}, index=pd.Index(tasks, name="task"))
        path = self.root / "meta/tasks.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        table.to_parquet(path.with_name("tasks.partial"))
        os.replace(path.with_name("tasks.partial"), path)

    def write_episode(
        self, table: pa.Table, row: dict[str, Any], stats: dict[str, _stats.Stats], videos: dict[str, float], first: int
    ) -> None:
        data = self._append(self.PATHS["data_path"], table, "index", first)
        row |= {"data/chunk_index": data[0], "data/file_index": data[1]}
        row |= {"dataset_from_index": first, "dataset_to_index": first + row["length"]}
        for key, seconds in videos.items():
            chunk, file = divmod(row["episode_index"], CHUNK)
            row |= {f"videos/{key}/chunk_index": chunk, f"videos/{key}/file_index": file}
            row |= {f"videos/{key}/from_timestamp": 0.0, f"videos/{key}/to_timestamp": seconds}
        for key, of in _stats.plain(stats).items():
            row |= {f"stats/{key}/{name}": value for name, value in of.items()}
        place = self._last(self.EPISODES)
        row |= {"meta/episodes/chunk_index": place[0], "meta/episodes/file_index": place[1]}
        self._append(self.EPISODES, pa.Table.from_pylist([row]), "episode_index", row["episode_index"])

    def _last(self, pattern: str) -> tuple[int, int]:
        """The file that the next rows go into: the last one, or the next if that is full."""
        place = (0, 0)
        while True:
            following = (place[0] + (place[1] + 1) // CHUNK, (place[1] + 1) % CHUNK)
            if not (self.root / pattern.format(chunk_index=following[0], file_index=following[1])).exists():
                break
            place = following
        path = self.root / pattern.format(chunk_index=place[0], file_index=place[1])
        return following if path.exists() and path.stat().st_size >= DATA_FILE_MB * 2**20 else place

    def _append(self, pattern: str, table: pa.Table, key: str, first: int) -> tuple[int, int]:
        """Adds rows to the last file. Rows from `first` on are of an episode that was not finished, and go."""
        place = self._last(pattern)
        path = self.root / pattern.format(chunk_index=place[0], file_index=place[1])
        if path.exists():
            before = pq.ParquetFile(path).read()
            before = before.filter(pa.compute.less(before[key], first))
            table = pa.concat_tables([before, table.cast(before.schema)]) if len(before) else table
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        pq.write_table(table, partial, compression="snappy")
        os.replace(partial, path)
        return place


class _V21:
    """Version 2.1: a data file and a video per camera for each episode; what is known of each is a line of JSON."""

    PATHS = {
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    }

    def __init__(self, root: Path):
        self.root = root

    def _path(self, pattern: str, episode: int, key: str = "") -> Path:
        return self.root / pattern.format(episode_chunk=episode // CHUNK, episode_index=episode, video_key=key)

    def video_path(self, key: str, episode: int) -> Path:
        return self._path(self.PATHS["video_path"], episode, key)

    def read_tasks(self) -> list[str]:
        return [line["task"] for line in self._lines("tasks")]

    def read_stats(self) -> dict[str, Any]:
        return {}

    def write_tasks(self, tasks: list[str]) -> None:
        self._write_lines("tasks", [{"task_index": k, "task": task} for k, task in enumerate(tasks)])

    def write_episode(
        self, table: pa.Table, row: dict[str, Any], stats: dict[str, _stats.Stats], videos: dict[str, float], first: int
    ) -> None:
        del videos, first
        path = self._path(self.PATHS["data_path"], row["episode_index"])
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        pq.write_table(table, partial, compression="snappy")
        os.replace(partial, path)
        # Lines of an episode that was not finished go.
        for name, line in (("episodes", row), ("episodes_stats", {"episode_index": row["episode_index"], "stats": _stats.plain(stats)})):
            kept = [old for old in self._lines(name) if old["episode_index"] < row["episode_index"]]
            self._write_lines(name, [*kept, line])

    def _lines(self, name: str) -> list[dict[str, Any]]:
        path = self.root / f"meta/{name}.jsonl"
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def _write_lines(self, name: str, lines: list[dict[str, Any]]) -> None:
        replace(self.root / f"meta/{name}.jsonl", "".join(json.dumps(line) + "\n" for line in lines).encode())
