"""HDF5 files for robomimic: `data/demo_N` with actions, rewards, dones, (next) observations."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ._frames import Feature, Frames, check_dtypes, checked_values
from ._spare import Spare

#: robomimic's `EnvType.GYM_TYPE`: an environment of `gym.make(env_name, **env_kwargs)`.
GYM_TYPE = 2
#: One demonstration in this many is for validation (`mask/valid`), the others for training
#: (`mask/train`).
VALIDATION_INTERVAL = 10


class RobomimicWriter:
    """Writes a robomimic file, a demonstration at a time.

    `observations` maps names to features as in `LeRobotWriter`; `video` and `image` features are
    uint8 arrays, compressed without loss. A frame has these, `actions` (float64 (`actions`,)) and
    `rewards`. robomimic's policies return actions in [-1, 1]: make the environment with
    `normalize=True`.

    `env_name` and `env_kwargs` make the environment again, by `gym.make(env_name, **env_kwargs)`;
    `robomimic_environment` reads them from one. robomimic's own `EnvGym` needs the old `gym` (four
    values a step, no seed, one flat observation), not Gymnasium: train with its rollouts turned off
    and evaluate here. Every tenth demonstration is in `mask/valid`, the others are in `mask/train`;
    robomimic's `split_train_val.py` makes other masks.

    An existing file is continued if it has the same observations, actions and environment
    (ValueError otherwise). A demonstration is in the file once `save_episode` has returned, and the
    file is complete at any time, even if the process is killed. The file is never changed in place:
    a spare beside it (`FILE.spare.partial`) gets each demonstration and is then swapped with it. So
    the cost of saving does not depend on the length of the file, but the disk needs room for two.
    (External links to a file a demonstration would need half the room, and would lose the data of a
    user who copies only the main file. Merging at the end would lose all after a kill.) `close`,
    the end of a `with` block or of the program removes the spare. Of several writers of a file one
    saves at a time.

    >>> options = {"observations": robomimic_observations(env), **robomimic_environment(env)}
    >>> with RobomimicWriter("lifts.hdf5", actions=10, **options) as writer:
    ...     for frame in episode:
    ...         writer.add_frame(frame)
    ...     writer.save_episode(last, success=True)
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        observations: dict[str, Feature],
        actions: int,
        env_name: str,
        env_kwargs: dict[str, Any] | None = None,
    ):
        check_dtypes(observations, ("video", "image"))
        reserved = {"actions", "rewards"} & observations.keys()
        if reserved:
            raise ValueError(
                f"observations: {', '.join(sorted(reserved))}: the writer adds these itself"
            )
        self.path = Path(path)
        self._observations = {
            key: dict(feature, shape=tuple(feature["shape"]))
            for key, feature in observations.items()
        }
        self._frames = Frames(
            self._observations
            | {
                "actions": {"dtype": "float64", "shape": (actions,)},
                "rewards": {"dtype": "float64", "shape": (1,)},
            }
        )
        self._env_args = _env_args(env_name, env_kwargs or {})
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._spare = Spare(self.path)
        # Removes files of a killed writer, unless another writer is active.
        self._spare.discard()
        if not self.path.exists():
            self._begin()
        self._check()

    def __enter__(self) -> RobomimicWriter:
        return self

    def __exit__(self, *why: object) -> None:
        self.close()

    def close(self) -> None:
        """Removes the spare and the frames of the current episode.

        A later save copies the file to a new spare.
        """
        self.discard_episode()
        self._spare.discard()

    def _begin(self) -> None:
        """Makes the file, without demonstrations, unless another writer has made it."""
        with self._spare.locked():
            if self.path.exists():
                return
            with _open(self._spare.path, "w") as file:
                data = file.create_group("data")
                data.attrs["total"] = 0
                data.attrs["env_args"] = json.dumps(self._env_args)
            self._spare.swap()

    def _check(self) -> None:
        """ValueError if the existing file has other observations, actions or environment."""
        with _open(self._spare.file, "r") as file:
            if "data" not in file or "env_args" not in file["data"].attrs:
                raise ValueError(
                    f"{self.path} is not a robomimic file (it has no group 'data' with 'env_args')"
                )
            data = file["data"]
            if json.loads(data.attrs["env_args"]) != self._env_args:
                raise ValueError(
                    f"{self.path} was recorded in another environment, "
                    f"{data.attrs['env_args']}; choose another file"
                )
            wanted = {
                key: tuple(feature["shape"])
                for key, feature in self._frames.features.items()
                if key != "rewards"
            }
            for name in _demos(data)[-1:]:
                demo = data[name]
                held = {key: values.shape[1:] for key, values in demo["obs"].items()} | {
                    "actions": demo["actions"].shape[1:]
                }
                if held != wanted:
                    raise ValueError(
                        f"{self.path} has other observations or actions, "
                        f"{held}; choose another file"
                    )

    @property
    def episodes(self) -> int:
        """Number of episodes in the file."""
        with _open(self._spare.file, "r") as file:
            return len(_demos(file["data"]))

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Adds a frame to the current episode.

        A wrong one is a ValueError that names the feature, and nothing is added.
        """
        self._frames.add(frame)

    def discard_episode(self) -> None:
        """Removes the frames of the current episode."""
        self._frames.clear()

    def save_episode(self, last: dict[str, Any], *, success: bool = False) -> int:
        """Writes the current episode and returns its index.

        `last` is the observation after the last action; a wrong one is a ValueError that names the
        feature. After a ValueError or an OSError (a full disk) the file is unchanged and the frames
        are kept, so that the caller can try again.
        """
        if len(self._frames) == 0:
            raise ValueError("the episode has no frames")
        last = checked_values("last", last, self._observations)
        with self._spare.locked():
            try:
                index = self._append(last, success)
                self._spare.swap()
            except BaseException:
                self._spare.drop()
                raise
        self._frames.clear()
        return index

    def _append(self, last: dict[str, Any], success: bool) -> int:
        """Brings the spare up to date and adds the current episode to it."""
        with self._open_spare() as spare, _open(self._spare.file, "r") as file:
            data, names = spare["data"], _demos(file["data"])
            for name in sorted(set(names) - set(_demos(data)), key=_number):
                file["data"].copy(name, data)
                _enter(spare, name)
            index = _number(names[-1]) + 1 if names else 0
            self._write(data.create_group(f"demo_{index}"), last, success)
            _enter(spare, f"demo_{index}")
        return index

    def _open_spare(self) -> h5py.File:
        spare = self._spare.take()
        try:
            return _open(spare, "r+")
        except OSError:
            # A reader still has it open from the time when it was the file.
            return _open(self._spare.copy(), "r+")

    def _write(self, demo: h5py.Group, last: dict[str, Any], success: bool) -> None:
        columns = {key: np.stack(values) for key, values in self._frames.columns.items()}
        dones = np.zeros(len(self._frames), dtype=np.int64)
        dones[-1] = 1
        demo.create_dataset("actions", data=columns["actions"])
        demo.create_dataset("rewards", data=columns["rewards"].reshape(-1))
        demo.create_dataset("dones", data=dones)
        for key in self._observations:
            now = columns[key]
            following = np.concatenate([now[1:], last[key][None]])
            packed = (
                {"compression": "gzip", "compression_opts": 1, "chunks": (1, *now.shape[1:])}
                if now.ndim > 2
                else {}
            )
            demo.create_dataset(f"obs/{key}", data=now, **packed)
            demo.create_dataset(f"next_obs/{key}", data=following, **packed)
        demo.attrs["num_samples"] = len(self._frames)
        demo.attrs["success"] = success


def _env_args(env_name: str, env_kwargs: dict[str, Any]) -> dict[str, Any]:
    """Robomimic's description of the environment, as it is read back from JSON."""
    content = {"env_name": env_name, "type": GYM_TYPE, "env_kwargs": env_kwargs}
    try:
        description: dict[str, Any] = json.loads(json.dumps(content))
    except (TypeError, ValueError) as why:
        raise ValueError(f"env_kwargs: {why}; they must be JSON values") from why
    return description


def _open(path: Path, mode: str) -> h5py.File:
    try:
        return h5py.File(path, mode)
    except OSError as why:
        raise OSError(f"{path} cannot be opened as HDF5: {why}") from why


def _number(name: str) -> int:
    return int(name.removeprefix("demo_"))


def _demos(data: h5py.Group) -> list[str]:
    """Names of the demonstrations, in the order of their recording."""
    return sorted((name for name in data if re.fullmatch(r"demo_\d+", name)), key=_number)


def _enter(file: h5py.File, name: str) -> None:
    """Adds a written demonstration to the total and to its mask."""
    data = file["data"]
    data.attrs.modify("total", data.attrs["total"] + data[name].attrs["num_samples"])
    mask = (
        "mask/valid"
        if _number(name) % VALIDATION_INTERVAL == VALIDATION_INTERVAL - 1
        else "mask/train"
    )
    names = file.get(mask)
    # Names are added in place. A mask of robomimic's script cannot grow and is replaced.
    if names is None or names.maxshape != (None,) or names.dtype.itemsize < len(name):
        held = [] if names is None else names[:].tolist()
        file.pop(mask, None)
        names = file.create_dataset(
            mask,
            data=np.array(held, dtype="S16"),
            dtype="S16",
            shape=(len(held),),
            maxshape=(None,),
            chunks=(1024,),
        )
    names.resize((len(names) + 1,))
    names[-1] = name.encode()
