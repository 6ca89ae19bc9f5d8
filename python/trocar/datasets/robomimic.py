"""HDF5 files as robomimic reads them: `data/demo_N` with actions, rewards, dones, observations and the next ones."""

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

#: Which of robomimic's kinds of environments it is: `EnvType.GYM_TYPE`, made by `gym.make(env_name, **env_kwargs)`.
GYM_TYPE = 2
#: Every so many-th demonstration is for validation (`mask/valid`), the others are for training (`mask/train`).
VALIDATION = 10


class RobomimicWriter:
    """Writes a robomimic file, a demonstration at a time.

    `observations` maps names to features as in `LeRobotWriter` (`video` or `image` for pictures, kept as 8-bit arrays and compressed
    without loss); frames have those, `actions` (as many numbers as `actions` says) and `rewards`. robomimic's policies give actions
    from -1 to 1: make the environment with `normalize=True`.

    `env_name` and `env_kwargs` say how the environment is made anew: `gym.make(env_name, **env_kwargs)`; `robomimic_environment`
    takes them from one. robomimic's own `EnvGym` speaks the old `gym` (four values a step, no seed, one flat observation), not
    Gymnasium: train with its rollouts turned off and evaluate here. Every tenth demonstration is in `mask/valid`, the others are in
    `mask/train`; robomimic's `split_train_val.py` makes other masks.

    A file that is there is gone on with if it has the same observations, actions and environment (`ValueError` otherwise). A
    demonstration is in the file once `save_episode` has returned, and the file is whole at any time, however this process ends. It
    is never changed in place: a spare beside it (`FILE.spare.partial`) takes each demonstration and then changes places with it, so
    saving costs the same however long the file is, but the disk needs room for two. (External links to a file for each demonstration
    would need it once, and would lose the data of whoever copies the one file; what is merged only at the end is missing after a
    kill.) `close`, the end of a `with` or of the program removes the spare. Of several writers of a file one saves at a time.

    >>> with RobomimicWriter("lifts.hdf5", observations=robomimic_observations(env), actions=10, **robomimic_environment(env)) as writer:
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
                f"observations: {', '.join(sorted(reserved))} are written by themselves"
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
        # What a killed writer has left goes, unless another one is at work here.
        self._spare.discard()
        if not self.path.exists():
            self._begin()
        self._check()

    def __enter__(self) -> RobomimicWriter:
        return self

    def __exit__(self, *why: object) -> None:
        self.close()

    def close(self) -> None:
        """Removes the spare; the episode under way is forgotten. Whoever saves again has another one made, by copying the file."""
        self.discard_episode()
        self._spare.discard()

    def _begin(self) -> None:
        """Makes the file, without demonstrations, if no other writer was faster."""
        with self._spare.alone():
            if self.path.exists():
                return
            with _open(self._spare.path, "w") as file:
                data = file.create_group("data")
                data.attrs["total"] = 0
                data.attrs["env_args"] = json.dumps(self._env_args)
            self._spare.swap()

    def _check(self) -> None:
        """Raises a `ValueError` if the file that is there holds something else."""
        with _open(self._spare.file, "r") as file:
            if "data" not in file or "env_args" not in file["data"].attrs:
                raise ValueError(
                    f"{self.path} is no robomimic file (it has no group 'data' with 'env_args')"
                )
            data = file["data"]
            if json.loads(data.attrs["env_args"]) != self._env_args:
                raise ValueError(
                    f"{self.path} was recorded in another environment, {data.attrs['env_args']}; write into another file"
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
                        f"{self.path} has other observations or actions, {held}; write into another file"
                    )

    @property
    def episodes(self) -> int:
        """Episodes in the file."""
        with _open(self._spare.file, "r") as file:
            return len(_demos(file["data"]))

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Takes a frame of the episode under way. A wrong one is named, and nothing of it is kept."""
        self._frames.add(frame)

    def discard_episode(self) -> None:
        """Forgets the episode under way."""
        self._frames.clear()

    def save_episode(self, last: dict[str, Any], *, success: bool = False) -> int:
        """Writes the episode under way and returns its index; `last` is the observation after its last action.

        A wrong `last` is a `ValueError` that names what is wrong. Then, and if it cannot be written (a disk that is full), the file
        is as it was, and the frames are kept, so that it may be tried again.
        """
        if len(self._frames) == 0:
            raise ValueError("the episode has no frames")
        last = checked_values("last", last, self._observations)
        with self._spare.alone():
            try:
                index = self._append(last, success)
                self._spare.swap()
            except BaseException:
                self._spare.drop()
                raise
        self._frames.clear()
        return index

    def _append(self, last: dict[str, Any], success: bool) -> int:
        """Brings the spare up to the file and adds the episode under way to it."""
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
            # Whoever opened the file when this was the file still reads it, and keeps it.
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
    """What robomimic makes an environment by, as it comes back out of JSON."""
    try:
        return json.loads(
            json.dumps({"env_name": env_name, "type": GYM_TYPE, "env_kwargs": env_kwargs})
        )
    except (TypeError, ValueError) as why:
        raise ValueError(f"env_kwargs: {why}; they are kept as JSON") from why


def _open(path: Path, mode: str) -> h5py.File:
    try:
        return h5py.File(path, mode)
    except OSError as why:
        raise OSError(f"{path} cannot be opened as HDF5: {why}") from why


def _number(name: str) -> int:
    return int(name.removeprefix("demo_"))


def _demos(data: h5py.Group) -> list[str]:
    """Names of the demonstrations, in the order in which they were recorded."""
    return sorted((name for name in data if re.fullmatch(r"demo_\d+", name)), key=_number)


def _enter(file: h5py.File, name: str) -> None:
    """Counts a demonstration that has been added, and puts it into its mask."""
    data = file["data"]
    data.attrs.modify("total", data.attrs["total"] + data[name].attrs["num_samples"])
    mask = "mask/valid" if _number(name) % VALIDATION == VALIDATION - 1 else "mask/train"
    names = file[mask] if mask in file else None
    # Names are added in place; a mask that robomimic's script has made cannot grow, and is made anew.
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
