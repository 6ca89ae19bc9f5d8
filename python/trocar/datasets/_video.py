"""Videos of episodes, by PyAV."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import av
import numpy as np


def check_shape(key: str, shape: tuple[int, ...]) -> None:
    """ValueError if pictures of this shape cannot be a video. `key` names them in errors."""
    height, width, channels = shape
    if channels != 3:
        raise ValueError(f"features: {key} has {channels} channels; a video must have 3")
    if height % 2 or width % 2:
        raise ValueError(
            f"features: {key} is {width}x{height}; the edges of a video must be even (px)"
        )


def write(
    path: Path, pictures: list[np.ndarray], fps: int, *, codec: str = "libx264", crf: int = 18
) -> dict[str, Any]:
    """Writes uint8 RGB pictures (height, width, 3) as a video.

    Every second frame is a key frame, so that readers find any frame quickly. The file is replaced
    atomically. Returns the `info` of the video in a LeRobot dataset.
    """
    height, width, _ = pictures[0].shape
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    with av.open(str(partial), "w", format="mp4") as output:
        # With one thread the same pictures give the same file.
        stream = output.add_stream(codec, fps, options={"crf": str(crf), "g": "2", "threads": "1"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            output.mux(stream.encode(frame))
        output.mux(stream.encode())
    os.replace(partial, path)
    with av.open(str(path)) as made:
        name = made.streams.video[0].codec.canonical_name
    return {
        "video.height": height,
        "video.width": width,
        "video.codec": name,
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }


def read(path: Path) -> np.ndarray:
    """All frames of a video: uint8 (frames, height, width, 3)."""
    with av.open(str(path)) as video:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)])
