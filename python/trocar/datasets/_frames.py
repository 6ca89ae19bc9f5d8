"""Shared by the writers: features, frames of the current episode, atomic replacement of files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

#: A feature: `{"dtype": "float32" | ... | "video", "shape": (...), "names": [...] | None}`.
Feature = dict[str, Any]

#: Numeric types of features.
NUMBERS = (
    "bool",
    "int8",
    "int16",
    "int32",
    "int64",
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "float16",
    "float32",
    "float64",
)


class Frames:
    """The frames of one episode, checked against their features."""

    def __init__(self, features: dict[str, Feature]):
        self.features = features
        self.columns: dict[str, list[np.ndarray]] = {}
        self.clear()

    def clear(self) -> None:
        """Removes all frames."""
        self.columns = {key: [] for key in self.features}

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), []))

    def add(self, frame: dict[str, Any]) -> None:
        """Adds a frame. A wrong one is a ValueError with the feature's name, and is not added."""
        for key, value in checked_values("frame", frame, self.features).items():
            self.columns[key].append(value)


def check_dtypes(features: dict[str, Feature], pictures: tuple[str, ...]) -> None:
    """ValueError that names the first feature whose type is no number and not in `pictures`."""
    for key, feature in features.items():
        dtype = feature.get("dtype")
        if dtype not in NUMBERS and dtype not in pictures:
            raise ValueError(
                f"features: {key} has dtype '{dtype}'; "
                f"it must be one of {', '.join((*pictures, *NUMBERS))}"
            )
        if dtype in pictures and len(feature["shape"]) != 3:
            raise ValueError(
                f"features: {key} has shape {tuple(feature['shape'])}; "
                "it must be (height, width, channels)"
            )


def checked_values(
    what: str, values: dict[str, Any], features: dict[str, Feature]
) -> dict[str, np.ndarray]:
    """`values` as arrays of the features' types and shapes. `what` names them in errors."""
    missing, unknown = features.keys() - values.keys(), values.keys() - features.keys()
    if missing or unknown:
        words = [
            f"{', '.join(sorted(keys))} {how}"
            for keys, how in ((missing, "missing"), (unknown, "unknown"))
            if keys
        ]
        raise ValueError(f"{what}: {'; '.join(words)}; the features are {', '.join(features)}")
    return {
        key: _checked_value(f"{what}: {key}", values[key], feature)
        for key, feature in features.items()
    }


def _checked_value(name: str, value: Any, feature: Feature) -> np.ndarray:
    """`value` as an array of the feature's type and shape."""
    kind = "uint8" if feature["dtype"] in ("video", "image") else feature["dtype"]
    array = np.asarray(value)
    shape = tuple(feature["shape"])
    if array.shape != shape and not (array.shape == () and shape == (1,)):
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape}")
    if kind == "uint8" and array.dtype != np.uint8:
        raise ValueError(f"{name} is {array.dtype}; pictures are uint8")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"{name} has a number that is not finite")
    if not np.can_cast(array.dtype, kind, casting="same_kind"):
        raise ValueError(f"{name} is {array.dtype}; it must be {kind}")
    # A copy, because environments write the next observation into the same array.
    return np.array(array, dtype=kind).reshape(shape)


def write_json(path: Path, value: Any) -> None:
    """Replaces a file by JSON atomically."""
    replace(path, json.dumps(value, indent=4).encode())


def replace(path: Path, content: bytes) -> None:
    """Replaces a file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_bytes(content)
    os.replace(partial, path)
