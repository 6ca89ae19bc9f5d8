"""A Gymnasium wrapper that writes observations and actions as demonstrations."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np

from ._frames import Feature
from .lerobot import LeRobotWriter
from .robomimic import RobomimicWriter


def features_of(env: gym.Env[Any, Any]) -> dict[str, Feature]:
    """Features of an environment's observations and actions, by LeRobot's names.

    `observation.state`, `observation.images.CAMERA`, `action`. Depth is left out.
    """
    unwrapped = env.unwrapped
    features: dict[str, Feature] = {}
    for key, space in _leaves(env.observation_space):
        if key.startswith("observation.depth"):
            continue
        if key.startswith("observation.images"):
            features[key] = {
                "dtype": "video",
                "shape": space.shape,
                "names": ["height", "width", "channels"],
            }
        else:
            names = getattr(unwrapped, "state_names", None) if key == "observation.state" else None
            features[key] = {"dtype": "float32", "shape": space.shape, "names": names}
    names = getattr(unwrapped, "action_names", None)
    features["action"] = {"dtype": "float32", "shape": env.action_space.shape, "names": names}
    return features


def _leaves(space: gym.Space[Any], name: str = "observation") -> list[tuple[str, gym.Space[Any]]]:
    """The boxes of a space, by LeRobot's names."""
    words = {"agent_pos": "state", "pixels": "images", "environment_state": "environment_state"}
    if isinstance(space, gym.spaces.Dict):
        return [
            leaf
            for key, part in space.items()
            for leaf in _leaves(part, f"{name}.{words.get(key, key)}")
        ]
    return [(f"{name}.state" if name == "observation" else name, space)]


def _values(observation: Any, space: gym.Space[Any]) -> dict[str, np.ndarray]:
    if isinstance(space, gym.spaces.Dict):
        flat: list[Any] = []

        def walk(value: Any, part: gym.Space[Any]) -> None:
            if isinstance(part, gym.spaces.Dict):
                for key, inner in part.items():
                    walk(value[key], inner)
            else:
                flat.append(value)

        walk(observation, space)
        return dict(zip((key for key, _ in _leaves(space)), flat))
    return {"observation.state": observation}


class Recorder(gym.Wrapper[Any, Any, Any, Any]):
    """Writes each episode of `env` by `writer` when it ends.

    With `only_successful` only episodes that passed are written. A writer with a frame rate must
    have the environment's, `env.metadata["render_fps"]` (ValueError otherwise), because the times
    of frames follow from it. A wrapper that runs several steps in one must say so in its
    `metadata`.

    >>> env = gym.make("trocar/GraspLift-v0")
    >>> writer = LeRobotWriter("lifts", fps=env.metadata["render_fps"], features=features_of(env))
    >>> env = Recorder(env, writer)
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        writer: LeRobotWriter | RobomimicWriter,
        *,
        only_successful: bool = False,
    ):
        super().__init__(env)
        env_fps, writer_fps = env.metadata.get("render_fps"), getattr(writer, "fps", None)
        if env_fps is not None and writer_fps is not None and writer_fps != env_fps:
            raise ValueError(
                f"fps: the writer has {writer_fps}, the environment runs {env_fps} steps a second; "
                f"make the writer with fps={env_fps}"
            )
        self.writer, self.only_successful = writer, only_successful
        self._observation: Any = None

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Resets the environment. The frames of an unfinished episode are removed."""
        self.writer.discard_episode()
        self._observation, info = self.env.reset(**options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Steps the environment and writes a frame: the observation before, and the action."""
        space = self.env.observation_space
        before = {key: np.array(v) for key, v in _values(self._observation, space).items()}
        result = self.env.step(action)
        self._observation, reward, terminated, truncated, info = result
        action = np.asarray(action, dtype=np.float64)
        if isinstance(self.writer, LeRobotWriter):
            frame = {
                key: value.astype(np.float32) if value.dtype == np.float64 else value
                for key, value in before.items()
                if key in self.writer.features
            }
            self.writer.add_frame(frame | {"action": action.astype(np.float32)})
        else:
            frame = {_short(key): value for key, value in before.items()}
            self.writer.add_frame(frame | {"actions": action, "rewards": float(reward)})
        if terminated or truncated:
            success = bool(info.get("is_success", False))
            if success or not self.only_successful:
                self._save(success)
            else:
                self.writer.discard_episode()
        return result

    def _save(self, success: bool) -> None:
        if isinstance(self.writer, LeRobotWriter):
            self.writer.save_episode(str(getattr(self.env.unwrapped, "task_description", "")))
        else:
            last = _values(self._observation, self.env.observation_space)
            self.writer.save_episode({_short(k): v for k, v in last.items()}, success=success)


def robomimic_observations(env: gym.Env[Any, Any]) -> dict[str, Feature]:
    """Features of an environment's observations for a `RobomimicWriter`.

    `state`, `CAMERA_image`, `CAMERA_depth`.
    """
    kinds = {"u": "image", "f": str(np.dtype(np.float32))}
    return {
        _short(key): {
            "dtype": kinds[np.dtype(space.dtype).kind],
            "shape": space.shape,
            "names": None,
        }
        for key, space in _leaves(env.observation_space)
    }


def robomimic_environment(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """`env_name` and `env_kwargs` of an environment for a `RobomimicWriter`.

    They make it again. ValueError for an environment that `gym.make` did not make.
    """
    if env.spec is None:
        raise ValueError("env: has no spec; make it by gym.make, or give env_name and env_kwargs")
    return {"env_name": env.spec.id, "env_kwargs": dict(env.spec.kwargs)}


def _short(key: str) -> str:
    """`observation.images.endoscope` as `endoscope_image`."""
    kind, *camera = key.removeprefix("observation.").split(".")
    if not camera:
        return kind
    return f"{camera[0]}_{'image' if kind == 'images' else kind}"
