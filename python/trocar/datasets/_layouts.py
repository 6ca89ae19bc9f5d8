"""How LeRobot datasets lie on disk, v3.0 and v2.1: which file an episode goes into, and what goes again of one that was not finished."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from . import _stats
from ._frames import replace, write_json

#: Files in a folder ("chunk"), at most.
CHUNK = 1000
#: Size of a data file from which on a new one begins [MB]. It is written again with every episode, so it is less than LeRobot's 100.
DATA_FILE_MB = 16


class V3:
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
        return self.root / self.PATHS["video_path"].format(
            video_key=key, chunk_index=chunk, file_index=file
        )

    def read_tasks(self) -> list[str]:
        path = self.root / "meta/tasks.parquet"
        return list(pd.read_parquet(path).index) if path.exists() else []

    def read_stats(self, episodes: int, frames: int) -> dict[str, _stats.Stats]:
        """Statistics of all episodes: those on disk, or, where these are of an unfinished episode too, the episodes' own once more."""
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
        """An episode's statistics out of its row; features have no slash in their names."""
        own: dict[str, dict[str, Any]] = {}
        for key, value in row.items():
            if key.startswith("stats/"):
                _, feature, name = key.split("/")
                own.setdefault(feature, {})[name] = value
        return _stats.from_plain(own)

    def write_stats(self, stats: dict[str, _stats.Stats]) -> None:
        write_json(self.root / "meta/stats.json", _stats.plain(stats))

    def forget(self, episodes: int, frames: int) -> None:
        """Removes rows of episodes from number `episodes` and of frames from number `frames` on; only the last files have any."""
        for pattern, key, first in (
            (self.PATHS["data_path"], "index", frames),
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
        """The files of `pattern` that are there, in order."""
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
        self._append(
            self.EPISODES, pa.Table.from_pylist([row]), "episode_index", row["episode_index"]
        )

    def _last(self, pattern: str) -> tuple[int, int]:
        """The file that the next rows go into: the last one, or the next if that is full."""
        files = self._files(pattern)
        full = bool(files) and files[-1].stat().st_size >= DATA_FILE_MB * 2**20
        return divmod(max(0, len(files) - 1) + int(full), CHUNK)

    def _append(self, pattern: str, table: pa.Table, key: str, first: int) -> tuple[int, int]:
        """Adds rows to the last file. Rows from `first` on are of an episode that could not be written whole, and go."""
        place = self._last(pattern)
        path = self.root / pattern.format(chunk_index=place[0], file_index=place[1])
        if path.exists():
            before = pq.ParquetFile(path).read()
            before = before.filter(pc.less(before[key], first))
            table = pa.concat_tables([before, table.cast(before.schema)]) if len(before) else table
        _write(path, table)
        return place


def _write(path: Path, table: pa.Table) -> None:
    """Writes a Parquet file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    pq.write_table(table, partial, compression="snappy")
    os.replace(partial, path)


class V21:
    """Version 2.1: a data file and a video per camera for each episode; what is known of each is a line of JSON."""

    PATHS = {
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    }

    def __init__(self, root: Path):
        self.root = root

    def _path(self, pattern: str, episode: int, key: str = "") -> Path:
        return self.root / pattern.format(
            episode_chunk=episode // CHUNK, episode_index=episode, video_key=key
        )

    def video_path(self, key: str, episode: int) -> Path:
        return self._path(self.PATHS["video_path"], episode, key)

    def read_tasks(self) -> list[str]:
        return [line["task"] for line in self._lines("tasks")]

    def read_stats(self, episodes: int, frames: int) -> dict[str, _stats.Stats]:
        """None: each episode has its own, and readers join them."""
        del episodes, frames
        return {}

    def write_stats(self, stats: dict[str, _stats.Stats]) -> None:
        """Nothing: see `read_stats`."""

    def forget(self, episodes: int, frames: int) -> None:
        """Removes what was written of episode number `episodes`; there is at most one beyond the last."""
        del frames
        for name in ("episodes", "episodes_stats"):
            lines = self._lines(name)
            kept = [line for line in lines if line["episode_index"] < episodes]
            if len(kept) < len(lines):
                self._write_lines(name, kept)
        self._path(self.PATHS["data_path"], episodes).unlink(missing_ok=True)

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
        _write(self._path(self.PATHS["data_path"], row["episode_index"]), table)
        # Lines of an episode that could not be written whole go.
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
