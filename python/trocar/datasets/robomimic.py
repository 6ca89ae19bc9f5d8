"""HDF5 files as robomimic reads them: `data/demo_N` with actions, rewards, dones, observations and the next ones."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ._frames import Feature, Frames


class RobomimicWriter:
    """Writes a robomimic file, an episode at a time.

    `observations` maps names to features as in `LeRobotWriter` (`video` or `image` for pictures, kept as 8-bit arrays and compressed without loss);
    frames have those, `actions` and `rewards`. `env_args` is kept as JSON for whoever makes the environment anew. A file that is there is gone on with.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        observations: dict[str, Feature],
        actions: int,
        env_args: dict[str, Any] | None = None,
    ):
        self.path = Path(path)
        self._observations = list(observations)
        self._frames = Frames(
            observations
            | {
                "actions": {"dtype": "float64", "shape": (actions,)},
                "rewards": {"dtype": "float64", "shape": (1,)},
            }
        )
        with self._open() as file:
            data = file.require_group("data")
            data.attrs.setdefault("total", 0)
            data.attrs["env_args"] = json.dumps({"env_name": "trocar", "type": 1, "env_kwargs": env_args or {}})

    def _open(self) -> h5py.File:
        try:
            return h5py.File(self.path, "a")
        except OSError as why:
            raise OSError(f"{self.path} cannot be written as HDF5: {why}") from why

    @property
    def episodes(self) -> int:
        """Episodes in the file."""
        with self._open() as file:
            return sum(name.startswith("demo_") for name in file["data"])

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Takes a frame of the episode under way."""
        self._frames.add(frame)

    def discard_episode(self) -> None:
        """Forgets the episode under way."""
        self._frames.clear()

    def save_episode(self, last: dict[str, Any], *, success: bool = False) -> int:
        """Writes the episode under way and returns its index; `last` is the observation after its last action."""
        length = len(self._frames)
        if length == 0:
            raise ValueError("the episode has no frames")
        columns = {key: np.stack(values) for key, values in self._frames.columns.items()}
        with self._open() as file:
            data = file["data"]
            # Under another name until it is whole.
            data.pop("partial", None)
            index = len(data)
            demo = data.create_group("partial")
            demo.create_dataset("actions", data=columns["actions"])
            demo.create_dataset("rewards", data=columns["rewards"].reshape(-1))
            dones = np.zeros(length, dtype=np.int64)
            dones[-1] = 1
            demo.create_dataset("dones", data=dones)
            for key in self._observations:
                now = columns[key]
                following = np.concatenate([now[1:], np.asarray(last[key], dtype=now.dtype)[None]])
                packed = {"compression": "gzip", "compression_opts": 1, "chunks": (1, *now.shape[1:])} if now.ndim > 2 else {}
                demo.create_dataset(f"obs/{key}", data=now, **packed)
                demo.create_dataset(f"next_obs/{key}", data=following, **packed)
            demo.attrs["num_samples"] = length
            demo.attrs["success"] = success
            data.move("partial", f"demo_{index}")
            data.attrs["total"] += length
        self._frames.clear()
        return index
