"""Options of environments, checked before anything is built: what is wrong is told by the option's name."""

from __future__ import annotations

import operator
from typing import Any, Sequence, TypedDict

import numpy as np

#: What can be observed. `agent_pos` is the state too, in a dict even where it is alone.
KINDS = ("state", "agent_pos", "rgb", "depth")

#: Greatest seed: arrays of seeds in `infos` have 64 bits with a sign.
MOST_SEED = 2**63 - 1


class Options(TypedDict, total=False):
    """Options of every environment, as `trocar.envs` tells them; their defaults are those of `Cells`."""

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


def whole(name: str, value: Any, low: int, high: int) -> int:
    """`value` as a whole number from `low` to `high`; otherwise a ValueError that names the option."""
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name}: is {value!r}; a whole number is wanted") from None
    if not low <= number <= high:
        raise ValueError(f"{name}: is {number}; {low} to {high} are possible")
    return number


def seed_of(value: Any) -> int:
    """A seed of an episode: 0 to 2^63 - 1."""
    return whole("seed", value, 0, MOST_SEED)


def kinds_of(obs: str) -> tuple[list[str], bool]:
    """What is observed (`state`, `rgb`, `depth`), and whether it is a dict."""
    names = obs.split("+") if isinstance(obs, str) else [obs]
    kinds = ["state" if name == "agent_pos" else name for name in names]
    if any(name not in KINDS for name in names) or len(set(kinds)) != len(kinds):
        raise ValueError(
            f"obs: '{obs}' cannot be observed; join any of {', '.join(KINDS)} by '+', the state once"
        )
    return kinds, names != ["state"]


def size_of(value: Any) -> tuple[int, int] | None:
    """Height and width [px], or None where none is given."""
    if value is None:
        return None
    try:
        height, width = (operator.index(n) for n in value)
    except (TypeError, ValueError):
        height = width = 0
    if not (8 <= height <= 8192 and 8 <= width <= 8192):
        raise ValueError(
            f"image_size: is {value!r}; height and width are wanted, whole numbers, 8 to 8192 pixels each"
        )
    return height, width


def mask_of(value: Any, count: int) -> np.ndarray:
    """Flags of the cells (count,) that are to be reset; all of them where None is given."""
    mask = np.ones(count, bool) if value is None else np.asarray(value)
    if mask.dtype != bool or mask.shape != (count,):
        raise ValueError(
            f"reset_mask: has shape {mask.shape} of {mask.dtype}; ({count},) of bool is needed"
        )
    return mask
