"""Statistics of features in LeRobot datasets: minimum, maximum, mean, deviation, quantiles."""

from __future__ import annotations

from typing import Any

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

#: Statistics of one feature by name. Arrays have the feature's shape, (3, 1, 1) for pictures;
#: `count` is (1,).
Stats = dict[str, np.ndarray]

#: Maximum number of pictures of an episode that its statistics use.
SAMPLED_PICTURES = 64
#: Maximum number of pixels along each edge of a picture that they use.
SAMPLED_PIXELS = 112


def of_numbers(values: np.ndarray) -> Stats:
    """Statistics of `values` (frames, ...) over the frames."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim == 1:
        values = values[:, None]
    return _of(values, axis=0, count=len(values))


def of_pictures(pictures: list[np.ndarray]) -> Stats:
    """Statistics per channel of uint8 pictures (height, width, 3), scaled so that white is 1.

    They are taken from a subset of the pictures and pixels.
    """
    step = max(1, len(pictures) // SAMPLED_PICTURES)
    chosen = pictures[::step]
    edge = max(1, max(chosen[0].shape[:2]) // SAMPLED_PIXELS)
    pixels = (
        np.concatenate([p[::edge, ::edge].reshape(-1, 3) for p in chosen]).astype(np.float64)
        / 255.0
    )
    stats = _of(pixels, axis=0, count=len(chosen))
    return {
        key: value if key == "count" else value.reshape(3, 1, 1) for key, value in stats.items()
    }


def _of(values: np.ndarray, axis: int, count: int) -> Stats:
    stats = {
        "min": values.min(axis),
        "max": values.max(axis),
        "mean": values.mean(axis),
        "std": values.std(axis),
        "count": np.array([count]),
    }
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=axis)
    return stats | dict(zip(QUANTILES, quantiles))


def merged(a: Stats, b: Stats) -> Stats:
    """Statistics of the union of two sets of values.

    Moments are exact. Quantiles are means weighted by the counts, as LeRobot merges them.
    """
    n, m = float(a["count"][0]), float(b["count"][0])
    wa, wb = n / (n + m), m / (n + m)
    mean = wa * a["mean"] + wb * b["mean"]
    variance = wa * (a["std"] ** 2 + (a["mean"] - mean) ** 2) + wb * (
        b["std"] ** 2 + (b["mean"] - mean) ** 2
    )
    stats = {
        "min": np.minimum(a["min"], b["min"]),
        "max": np.maximum(a["max"], b["max"]),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": a["count"] + b["count"],
    }
    return stats | {name: wa * a[name] + wb * b[name] for name in QUANTILES}


def plain(stats: dict[str, Stats]) -> dict[str, Any]:
    """`stats` as lists of numbers, for JSON and Parquet."""
    return {key: {name: value.tolist() for name, value in of.items()} for key, of in stats.items()}


def from_plain(stats: dict[str, Any]) -> dict[str, Stats]:
    """The inverse of `plain`."""
    return {
        key: {name: np.asarray(value) for name, value in of.items()} for key, of in stats.items()
    }
