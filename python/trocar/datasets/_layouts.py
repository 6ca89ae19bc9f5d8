"""The layouts of LeRobot datasets, v3.0 and v2.1: the files of an episode.

They also remove the files of an unfinished episode.
"""

from __future__ import annotations

import json
import os
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from . import _stats
from ._frames import replace, write_json

#: Maximum number of files in a folder ("chunk").
CHUNK = 1000
#: Size at which a data file is full (MiB). LeRobot has 100; a file is written again with every
#: episode, so this is less.
DATA_FILE_MB = 16


class Layout(ABC):
    """Files of a dataset in the folder `root`, except `meta/info.json`."""

    #: Paths and sizes in `info.json`.
    PATHS: ClassVar[dict[str, Any]]

    def __init__(self, root: Path):
        self.root = root

    @abstractmethod
    def video_path(self, key: str, episode: int) -> Path:
        """The video of the feature `key` in an episode."""

    @abstractmethod
    def read_tasks(self) -> list[str]:
        """The tasks in words, by index."""

    @abstractmethod
    def write_tasks(self, tasks: list[str]) -> None:
        """Writes the tasks in words."""

    @abstractmethod
    def read_stats(self, episodes: int, frames: int) -> dict[str, _stats.Stats]:
        """Statistics of all `episodes`, which have `frames` frames, by feature."""

    @abstractmethod
    def write_stats(self, stats: dict[str, _stats.Stats]) -> None:
        """Writes the statistics of all episodes."""

    @abstractmethod
    def remove_from(self, episodes: int, frames: int) -> None:
        """Removes the rows of episode number `episodes` and of frame number `frames` and later."""

    @abstractmethod
    def write_episode(
        self,
        table: pa.Table,
        row: dict[str, Any],
        stats: dict[str, _stats.Stats],
        videos: dict[str, float],
        first: int,
    ) -> None:
        """Writes an episode: a row of `table` a frame, the first of which has the index `first`.

        `row`: what readers know about the episode. `videos`: duration (s) by feature.
        """


class V3(Layout):
    """Version 3.0: episodes share data files, and `meta/episodes` has a row for each.

    Here each episode has videos of its own.
    """

    DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    PATHS: ClassVar[dict[str, Any]] = {
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": 200,
        "data_path": DATA,
        "video_path": VIDEO,
    }
    EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

    def video_path(self, key: str, episode: int) -> Path:
        chunk, file = divmod(episode, CHUNK)
        return self.root / self.VIDEO.format(video_key=key, chunk_index=chunk, file_index=file)

    def read_tasks(self) -> list[str]:
        path = self.root / "meta/tasks.parquet"
        return list(pd.read_parquet(path).index) if path.exists() else []

    def read_stats(self, episodes: int, frames: int) -> dict[str, _stats.Stats]:
        """Those on disk, or merged from each episode's if the former include an unfinished one."""
        path = self.root / "meta/stats.json"
        if episodes == 0:
            path.unlink(missing_ok=True)
            return {}
        whole = _stats.from_plain(json.loads(path.read_text())) if path.exists() else {}
        if whole and int(whole["index"]["count"][0]) == frames:
            return whole
        whole = {}
        for file in self._files(self.EPISODES):
            for row in pq.read_table(file).to_pylist():
                own = self._stats_of(row)
                whole = {
                    key: _stats.merged(whole[key], s) if key in whole else s
                    for key, s in own.items()
                }
        self.write_stats(whole)
        return whole

    @staticmethod
    def _stats_of(row: dict[str, Any]) -> dict[str, _stats.Stats]:
        """An episode's statistics from its row. Names of features have no slash."""
        own: dict[str, dict[str, Any]] = {}
        for key, value in row.items():
            if key.startswith("stats/"):
                _, feature, name = key.split("/")
                own.setdefault(feature, {})[name] = value
        return _stats.from_plain(own)

    def write_stats(self, stats: dict[str, _stats.Stats]) -> None:
        write_json(self.root / "meta/stats.json", _stats.plain(stats))

    def remove_from(self, episodes: int, frames: int) -> None:
        # Only the last files have any.
        for pattern, key, first in (
            (self.DATA, "index", frames),
            (self.EPISODES, "episode_index", episodes),
        ):
            for path in reversed(self._files(pattern)):
                table = pq.ParquetFile(path).read()
                kept = table.filter(pc.less(table[key], first))
                if len(kept) == len(table):
                    break
                if len(kept):
                    _write(path, kept)
                else:
                    path.unlink()

    def _files(self, pattern: str) -> list[Path]:
        """The existing files of `pattern`, in order."""
        found, place = [], (0, 0)
        while (
            path := self.root / pattern.format(chunk_index=place[0], file_index=place[1])
        ).exists():
            found.append(path)
            place = (place[0] + (place[1] + 1) // CHUNK, (place[1] + 1) % CHUNK)
        return found

    def write_tasks(self, tasks: list[str]) -> None:
        table = pd.DataFrame({"task_index": range(len(tasks))}, index=pd.Index(tasks, name="task"))
        path = self.root / "meta/tasks.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        table.to_parquet(path.with_name("tasks.partial"))
        os.replace(path.with_name("tasks.partial"), path)

    def write_episode(
        self,
        table: pa.Table,
        row: dict[str, Any],
        stats: dict[str, _stats.Stats],
        videos: dict[str, float],
        first: int,
    ) -> None:
        data = self._append(self.DATA, table, "index", first)
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
        self._append(
            self.EPISODES, pa.Table.from_pylist([row]), "episode_index", row["episode_index"]
        )

    def _last(self, pattern: str) -> tuple[int, int]:
        """The file of the next rows: the last one, or a new one if that is full."""
        files = self._files(pattern)
        full = bool(files) and files[-1].stat().st_size >= DATA_FILE_MB * 2**20
        return divmod(max(0, len(files) - 1) + int(full), CHUNK)

    def _append(self, pattern: str, table: pa.Table, key: str, first: int) -> tuple[int, int]:
        """Adds rows to the last file. Replaces rows from `first` on, of an unfinished episode."""
        place = self._last(pattern)
        path = self.root / pattern.format(chunk_index=place[0], file_index=place[1])
        if path.exists():
            before = pq.ParquetFile(path).read()
            before = before.filter(pc.less(before[key], first))
            table = pa.concat_tables([before, table.cast(before.schema)]) if len(before) else table
        _write(path, table)
        return place


def _write(path: Path, table: pa.Table) -> None:
    """Replaces a Parquet file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    pq.write_table(table, partial, compression="snappy")
    os.replace(partial, path)


class V21(Layout):
    """Version 2.1: each episode has a data file, a video a camera and a line of JSON."""

    DATA = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    VIDEO = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
    PATHS: ClassVar[dict[str, Any]] = {
        "data_path": DATA,
        "video_path": VIDEO,
    }

    def _path(self, pattern: str, episode: int, key: str = "") -> Path:
        return self.root / pattern.format(
            episode_chunk=episode // CHUNK, episode_index=episode, video_key=key
        )

    def video_path(self, key: str, episode: int) -> Path:
        return self._path(self.VIDEO, episode, key)

    def read_tasks(self) -> list[str]:
        return [line["task"] for line in self._lines("tasks")]

    def read_stats(self, episodes: int, frames: int) -> dict[str, _stats.Stats]:
        """None: each episode has its own, and readers merge them."""
        del episodes, frames
        return {}

    def write_stats(self, stats: dict[str, _stats.Stats]) -> None:
        """Nothing: see `read_stats`."""

    def remove_from(self, episodes: int, frames: int) -> None:
        # There is at most one unfinished episode.
        del frames
        for name in ("episodes", "episodes_stats"):
            lines = self._lines(name)
            kept = [line for line in lines if line["episode_index"] < episodes]
            if len(kept) < len(lines):
                self._write_lines(name, kept)
        self._path(self.DATA, episodes).unlink(missing_ok=True)

    def write_tasks(self, tasks: list[str]) -> None:
        self._write_lines(
            "tasks", [{"task_index": k, "task": task} for k, task in enumerate(tasks)]
        )

    def write_episode(
        self,
        table: pa.Table,
        row: dict[str, Any],
        stats: dict[str, _stats.Stats],
        videos: dict[str, float],
        first: int,
    ) -> None:
        del videos, first
        _write(self._path(self.DATA, row["episode_index"]), table)
        # Lines of an unfinished episode are removed.
        for name, line in (
            ("episodes", row),
            (
                "episodes_stats",
                {"episode_index": row["episode_index"], "stats": _stats.plain(stats)},
            ),
        ):
            kept = [old for old in self._lines(name) if old["episode_index"] < row["episode_index"]]
            self._write_lines(name, [*kept, line])

    def _lines(self, name: str) -> list[dict[str, Any]]:
        path = self.root / f"meta/{name}.jsonl"
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def _write_lines(self, name: str, lines: list[dict[str, Any]]) -> None:
        replace(
            self.root / f"meta/{name}.jsonl",
            "".join(json.dumps(line) + "\n" for line in lines).encode(),
        )
