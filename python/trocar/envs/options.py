"""Options of environments, checked before anything is built.

Errors begin with the option's name.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np

#: Observations. `agent_pos` is the state too, in a dict even when it is alone.
KINDS = ("state", "agent_pos", "rgb", "depth")

#: Greatest seed: arrays of seeds in `infos` are signed 64-bit integers.
MAX_SEED = 2**63 - 1

#: The first seed of unseen episodes: the seed of an episode decides its split.
FIRST_UNSEEN = 1_000_000
#: Least and greatest seed of a split.
SPLITS = {
    "seen": (0, FIRST_UNSEEN - 1),
    "unseen": (FIRST_UNSEEN, MAX_SEED),
    "both": (0, MAX_SEED),
}

#: Range of the edges of a picture (px).
MIN_IMAGE_PX, MAX_IMAGE_PX = 8, 8192


class Options(TypedDict, total=False):
    """Options of every environment (see `trocar.envs`). `Cells` has their defaults."""

    task: str | None
    obs: str
    actions: str
    normalize: bool
    episode_s: float | None
    threads: int
    privileged: bool
    cameras: Sequence[str] | None
    image_size: tuple[int, int] | None
    sensor_noise: bool
    variation: str | None
    split: str
    backend: str | None


def checked_int(name: str, value: Any, low: int, high: int) -> int:
    """`value` as an integer in [`low`, `high`]; otherwise a ValueError that names the option."""
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name}: is {value!r}; it must be an integer") from None
    if not low <= number <= high:
        raise ValueError(f"{name}: is {number}; it must be in [{low}, {high}]")
    return number


def checked_split(value: Any) -> str:
    """A split by its name."""
    if value not in SPLITS:
        raise ValueError(f"split: {value!r} is unknown; it must be one of {', '.join(SPLITS)}")
    return str(value)


def checked_seed(value: Any, split: str) -> int:
    """A seed of an episode of `split`."""
    seed = checked_int("seed", value, 0, MAX_SEED)
    low, high = SPLITS[split]
    if not low <= seed <= high:
        raise ValueError(f"seed: is {seed}; seeds of split {split} are in [{low}, {high}]")
    return seed


def drawn_seed(rng: np.random.Generator, split: str) -> int:
    """A random seed of an episode of `split`."""
    low = SPLITS[split][0]
    # Seen and unseen episodes are as likely in both.
    return low + int(rng.integers(2 * FIRST_UNSEEN if split == "both" else FIRST_UNSEEN))


def kinds_of(obs: str) -> tuple[list[str], bool]:
    """The observed kinds (`state`, `rgb`, `depth`), and whether the observation is a dict."""
    names = obs.split("+") if isinstance(obs, str) else [obs]
    kinds = ["state" if name == "agent_pos" else name for name in names]
    if any(name not in KINDS for name in names) or len(set(kinds)) != len(kinds):
        raise ValueError(
            f"obs: '{obs}' is unknown; it must be some of {', '.join(KINDS)}, "
            "joined by '+', the state once"
        )
    return kinds, names != ["state"]


def checked_size(value: Any) -> tuple[int, int] | None:
    """Height and width (px), or None if `value` is None."""
    if value is None:
        return None
    try:
        height, width = (operator.index(n) for n in value)
    except (TypeError, ValueError):
        height = width = 0
    if not all(MIN_IMAGE_PX <= n <= MAX_IMAGE_PX for n in (height, width)):
        raise ValueError(
            f"image_size: is {value!r}; it must be (height, width), "
            f"integers in [{MIN_IMAGE_PX}, {MAX_IMAGE_PX}] (px)"
        )
    return height, width


def checked_mask(value: Any, count: int) -> np.ndarray:
    """Flags (count,) of the cells to reset; all cells if `value` is None."""
    mask = np.ones(count, bool) if value is None else np.asarray(value)
    if mask.dtype != bool or mask.shape != (count,):
        raise ValueError(
            f"reset_mask: has shape {mask.shape} of {mask.dtype}; it must be ({count},) of bool"
        )
    return mask
