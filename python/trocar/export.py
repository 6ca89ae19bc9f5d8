r"""Datasets of recorded episodes, rendered after the fact: `trocar export`.

    trocar evaluate cell-a --policy scripted --episodes 50 --surfaces -o lifts
    trocar export lifts -o dataset --format lerobot --cameras endoscope d405 --size 224x224

The pictures are made of `surfaces.trocar` beside each episode, without simulation: any camera of
the scene, any size, one picture every control period, however fast the episode was recorded. An
episode without that file is replayed, and every step compared with the recorded one.

Only episodes that passed are exported, unless all are asked for. Frames of demonstrations have
`actor` in a LeRobot dataset: who moved the left and the right arm (0 the policy, 1 an operator, 2
nobody while an operator had it).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._native import Recorded
from ._progress import Bar
from .datasets import LeRobotWriter, RobomimicWriter
from .envs.cells import RECORDING_CAMERA, phantoms_folder

LAYOUTS = ("lerobot", "robomimic")
#: The file that makes a folder an episode's.
EPISODE_FILE = "episode.trocar"
#: Its channels, and the columns of demonstrations beside them; the file of a demonstration.
CHANNELS_FILE = "channels.parquet"
ACTORS = ("left_actor", "right_actor")
ACTORS_FILE = "actors.csv"
#: Called with the numbers of finished and of missing episodes: before the first and after each.
Progress = Callable[[int, int], None]


def find_episodes(sources: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The folders of all episodes in `sources`: episodes, campaigns, folders of demonstrations.

    In the order of `sources`, and of their names. ValueError for one without an episode.
    """
    found: list[Path] = []
    for source in map(Path, sources):
        inside = sorted(path.parent for path in source.rglob(EPISODE_FILE))
        if not inside:
            raise ValueError(
                f"{source}: has no {EPISODE_FILE}; name an episode or a folder of such"
            )
        found += [folder for folder in inside if folder not in found]
    return found


class _Episode:
    """A recorded episode with its pictures."""

    def __init__(self, folder: Path, **options: Any):
        self.folder = folder
        self.native = Recorded(folder, **options)
        self.header: dict[str, Any] = json.loads(self.native.header)
        spaces = {space for space, _ in self.native.actions()} or {"pivots"}
        if len(spaces) > 1:
            raise ValueError(f"{folder}: its actions are of two spaces, {' and '.join(spaces)}")
        self.space = spaces.pop()
        self.limits = next(a for a in self.header["actions"] if a["space"] == self.space)
        self.actions = np.array([numbers for _, numbers in self.native.actions()])

    @property
    def fps(self) -> int:
        """Frames a second. ValueError unless it is a whole number."""
        rate: float = 1.0 / self.header["period_s"]
        if abs(rate - round(rate)) > 1e-6:
            raise ValueError(
                f"{self.folder}: {rate} control periods a second; a dataset needs whole"
            )
        return round(rate)

    def sizes(
        self, cameras: Sequence[str] | None, size: tuple[int, int] | None
    ) -> dict[str, tuple[int, int]]:
        """Height and width of the pictures, by camera (default: all but the recording camera)."""
        known = {
            camera["name"]: camera["policy_size_px"][::-1] for camera in self.header["cameras"]
        }
        if cameras is None:
            cameras = [name for name in known if name != RECORDING_CAMERA]
        for name in cameras:
            if name not in known:
                raise ValueError(
                    f"cameras: '{name}' is unknown; {self.folder} has {', '.join(known)}"
                )
        return {name: size or tuple(known[name]) for name in cameras}

    def frames(self, sizes: dict[str, tuple[int, int]]) -> Any:
        """State, score and pictures at the start and after every step."""
        for k in range(self.header["frames"]):
            if k and not self.native.advance():
                raise ValueError(f"{self.folder}: ends after {k} frames")
            if abs(self.native.time_s - k * self.header["period_s"]) > 1e-6:
                raise ValueError(f"{self.folder}: frame {k} is of {self.native.time_s} s")
            pictures = {name: self.native.picture(name, *size) for name, size in sizes.items()}
            yield self.native.state, self.native.score, pictures

    def actors(self) -> np.ndarray:
        """Who moved the left and the right arm in each step (steps, 2).

        0 the policy, 1 an operator, 2 nobody while an operator had it. Policies alone where nobody
        noted it.
        """
        import pyarrow.parquet as pq

        table = pq.ParquetFile(self.folder / CHANNELS_FILE)
        if not set(ACTORS) <= set(table.schema_arrow.names):
            return np.zeros((len(self.actions), len(ACTORS)), np.float32)
        columns = table.read(columns=list(ACTORS))
        return np.stack([columns[name].to_numpy() for name in ACTORS], 1).astype(np.float32)

    def normalized(self) -> np.ndarray:
        """The actions with every number in [-1, 1], as environments take with `normalize=True`."""
        low, high = np.array(self.limits["low"]), np.array(self.limits["high"])
        return np.asarray((2.0 * (self.actions - low) / (high - low) - 1.0).clip(-1.0, 1.0))


class _LeRobot:
    """Writes a LeRobot dataset.

    With `acted` each frame says who moved the arms, as learners from interventions need it.
    """

    def __init__(
        self, output: Path, episode: _Episode, sizes: dict[str, tuple[int, int]], acted: bool
    ):
        self.acted = acted
        names = episode.header["state_names"]
        features: dict[str, Any] = {
            "observation.state": {"dtype": "float32", "shape": (len(names),), "names": names}
        }
        for camera, size in sizes.items():
            features[f"observation.images.{camera}"] = {
                "dtype": "video",
                "shape": (*size, 3),
                "names": ["height", "width", "channels"],
            }
        names = episode.limits["names"]
        features["action"] = {"dtype": "float32", "shape": (len(names),), "names": names}
        if acted:
            features["actor"] = {"dtype": "float32", "shape": (2,), "names": list(ACTORS)}
        self.writer = LeRobotWriter(output, fps=episode.fps, features=features)

    def write(self, episode: _Episode, sizes: dict[str, tuple[int, int]]) -> None:
        actors = episode.actors() if self.acted else None
        for k, ((state, _, pictures), action) in enumerate(
            zip(episode.frames(sizes), episode.actions)
        ):
            self.writer.add_frame(
                {"observation.state": state, "action": action.astype(np.float32)}
                | {f"observation.images.{camera}": p for camera, p in pictures.items()}
                | ({} if actors is None else {"actor": actors[k]})
            )
        self.writer.save_episode(episode.header["prompt"])

    def close(self) -> None:
        """Nothing: every episode is written."""


class _Robomimic:
    """Writes a robomimic file. The actions are in [-1, 1]."""

    def __init__(self, output: Path, episode: _Episode, sizes: dict[str, tuple[int, int]]):
        header = episode.header
        observations: dict[str, Any] = {
            "state": {"dtype": "float32", "shape": (len(header["state_names"]),), "names": None}
        }
        for camera, size in sizes.items():
            shape = (*size, 3)
            observations[f"{camera}_image"] = {"dtype": "image", "shape": shape, "names": None}
        words = header["task"].replace("-", " ").title().replace(" ", "")
        options = {
            "scene": header["scene"],
            "obs": "state+rgb" if sizes else "state",
            "cameras": list(sizes),
            "image_size": list(next(iter(sizes.values()), ())) or None,
            "actions": episode.space,
            "normalize": True,
        }
        self.writer = RobomimicWriter(
            output,
            observations=observations,
            actions=len(episode.limits["names"]),
            env_name=f"trocar/{words}-v0",
            env_kwargs=options,
        )

    def write(self, episode: _Episode, sizes: dict[str, tuple[int, int]]) -> None:
        stages, actions = episode.header["stages"], episode.normalized()
        before: tuple[float, dict[str, Any]] | None = None
        last: dict[str, Any] = {}
        for k, (state, score, pictures) in enumerate(episode.frames(sizes)):
            last = {"state": state} | {f"{camera}_image": p for camera, p in pictures.items()}
            if before is not None:
                # As the environments' reward: the gain in stages.
                reward = stages * (score - before[0])
                self.writer.add_frame(before[1] | {"actions": actions[k - 1], "rewards": reward})
            before = (score, last)
        self.writer.save_episode(last, success=episode.header["passed"])

    def close(self) -> None:
        self.writer.close()


def export(
    sources: Sequence[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    layout: str = "lerobot",
    cameras: Sequence[str] | None = None,
    size: tuple[int, int] | None = None,
    failed: bool = False,
    plain_light: bool = False,
    specimen: str | os.PathLike[str] | None = None,
    phantoms: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Writes the episodes in `sources` as a dataset, rendered now, and returns its figures.

    - `layout`: `lerobot` (a folder) or `robomimic` (an HDF5 file).
    - `cameras`: of the scene (default: all but the recording camera); an empty list for none.
    - `size`: height and width of all pictures (px) (default: each camera's `policy_size_px`).
    - `failed`: also export episodes that did not pass.
    - `plain_light`: light, exposure, gloss and tint of the scene, not those that were drawn.
    - `specimen`: folder of the specimen, if it was moved.

    ValueError for what cannot be exported, by its folder. `output` appears whole or not at all.
    """
    if layout not in LAYOUTS:
        raise ValueError(f"format: '{layout}' is unknown; it must be {' or '.join(LAYOUTS)}")
    output = Path(output)
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise ValueError(f"{output}: exists; choose another")
    folders = find_episodes(sources)
    options = {
        "phantoms": phantoms if phantoms is not None else phantoms_folder(),
        "specimen": specimen,
        "plain_light": plain_light,
    }
    progress = progress or (lambda done, missing: None)
    progress(0, len(folders))
    output.parent.mkdir(parents=True, exist_ok=True)
    partial = output.with_name(f".{output.name}.partial-{os.getpid()}")
    try:
        made = _write(folders, partial, layout, cameras, size, failed, progress, options)
        if output.exists():
            # Empty.
            output.rmdir()
        os.replace(partial, output)
    finally:
        # Nothing is there after a success.
        for path in [
            path for path in output.parent.iterdir() if path.name.startswith(partial.name)
        ]:
            _remove(path)
    return {"output": str(output), "format": layout} | made


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _write(
    folders: list[Path],
    output: Path,
    layout: str,
    cameras: Sequence[str] | None,
    size: tuple[int, int] | None,
    failed: bool,
    progress: Progress,
    options: dict[str, Any],
) -> dict[str, Any]:
    """Writes the dataset and returns its figures. `options` are those of `Recorded`."""
    writer: _LeRobot | _Robomimic | None = None
    first: tuple[Any, ...] | None = None
    frames, exported, notes = 0, 0, []
    acted = any((folder / ACTORS_FILE).exists() for folder in folders)
    for done, folder in enumerate(folders, 1):
        result = folder / "result.json"
        # An episode that did not pass need not be replayed.
        passed = result.exists() and json.loads(result.read_text()).get("passed", False)
        if not passed and not failed:
            progress(done, len(folders))
            continue
        episode = _Episode(folder, **options)
        sizes = episode.sizes(cameras, size)
        kind = (episode.fps, episode.space, episode.limits["names"], sizes)
        if writer is None:
            first = kind
            writer = (
                _LeRobot(output, episode, sizes, acted)
                if layout == "lerobot"
                else _Robomimic(output, episode, sizes)
            )
        elif kind != first:
            raise ValueError(
                f"{folder}: has another rate, other actions or pictures than the first"
            )
        writer.write(episode, sizes)
        if note := episode.header["note"]:
            notes.append(f"{folder}: {note}")
        exported, frames = exported + 1, frames + episode.header["steps"]
        progress(done, len(folders))
    if writer is None:
        raise ValueError(
            f"none of {len(folders)} episodes passed; --all exports those that did not, too"
        )
    writer.close()
    return {
        "found": len(folders),
        "episodes": exported,
        "frames": frames,
        "cameras": list(sizes),
        "notes": notes,
    }


def _size(text: str) -> tuple[int, int]:
    """Height and width (px) of `WIDTHxHEIGHT`."""
    width, _, height = text.partition("x")
    return int(height), int(width)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.export",
        description="Datasets of recorded episodes, rendered after the fact.",
    )
    parser.add_argument("sources", nargs="+", type=Path, help="episodes, campaigns, or folders")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder, or .hdf5 file")
    parser.add_argument("--format", default="lerobot", choices=LAYOUTS)
    parser.add_argument("--cameras", nargs="*", metavar="NAME", help="(default: all but recording)")
    parser.add_argument("--size", type=_size, metavar="WxH", help="of all pictures (px)")
    parser.add_argument("--all", action="store_true", help="also episodes that did not pass")
    parser.add_argument(
        "--plain-light",
        action="store_true",
        help="the scene's, not what was drawn for each episode",
    )
    parser.add_argument("--specimen", type=Path, help="specimen folder, if it was moved")
    parser.add_argument("--phantoms", type=Path, help="folder of phantoms")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    options = parser.parse_args(arguments)
    bar = Bar()
    try:
        made = export(
            options.sources,
            options.output,
            layout=options.format,
            cameras=options.cameras,
            size=options.size,
            failed=options.all,
            plain_light=options.plain_light,
            specimen=options.specimen,
            phantoms=options.phantoms,
            progress=None if options.quiet else bar,
        )
    except (ValueError, OSError) as why:
        bar.print(f"error: {why}")
        return 2
    except KeyboardInterrupt:
        bar.print("interrupted; no partial output was left")
        return 130
    if options.json:
        print(json.dumps(made))
        return 0
    for note in made["notes"]:
        print(f"note: {note}")
    print(
        f"{made['episodes']} of {made['found']} episodes, {made['frames']} frames, "
        f"cameras {', '.join(made['cameras']) or 'none'}: {made['output']} ({made['format']})"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
