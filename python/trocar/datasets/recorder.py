"""A Gymnasium wrapper that writes what an environment sees and is told as demonstrations."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from ._frames import Feature
from .lerobot import LeRobotWriter
from .robomimic import RobomimicWriter


def features_of(env: gym.Env) -> dict[str, Feature]:
    """Features of an environment's observations and actions, by LeRobot's names: `observation.state`, `observation.images.CAMERA`, `action`."""
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


def _leaves(space: gym.Space, name: str = "observation") -> list[tuple[str, gym.spaces.Box]]:
    """The boxes of a space, by LeRobot's names."""
    words = {"agent_pos": "state", "pixels": "images", "environment_state": "environment_state"}
    if isinstance(space, gym.spaces.Dict):
        return [
            leaf
            for key, part in space.items()
            for leaf in _leaves(part, f"{name}.{words.get(key, key)}")
        ]
    return [(f"{name}.state" if name == "observation" else name, space)]


def _values(observation: Any, space: gym.Space) -> dict[str, np.ndarray]:
    if isinstance(space, gym.spaces.Dict):
        flat: list[Any] = []

        def walk(value: Any, part: gym.Space) -> None:
            if isinstance(part, gym.spaces.Dict):
                for key, inner in part.items():
                    walk(value[key], inner)
            else:
                flat.append(value)

        walk(observation, space)
        return dict(zip((key for key, _ in _leaves(space)), flat))
    return {"observation.state": observation}


class Recorder(gym.Wrapper):
    """Writes each episode of `env` with `writer` when it ends: all of them, or with `only_successful` those that reached their goal.

    A writer with a rate must have the environment's, `env.metadata["render_fps"]` (`ValueError` otherwise): the times of frames follow
    from it. A wrapper that does several steps in one says so in its own `metadata`.

    >>> env = gym.make("trocar/GraspLift-v0")
    >>> writer = LeRobotWriter("lifts", fps=env.metadata["render_fps"], features=features_of(env))
    >>> env = Recorder(env, writer)
    """

    def __init__(
        self,
        env: gym.Env,
        writer: LeRobotWriter | RobomimicWriter,
        *,
        only_successful: bool = False,
    ):
        super().__init__(env)
        steps, written = env.metadata.get("render_fps"), getattr(writer, "fps", None)
        if steps is not None and written is not None and written != steps:
            raise ValueError(
                f"fps: the writer has {written}, the environment does {steps} steps a second; make the writer with fps={steps}"
            )
        self.writer, self.only_successful = writer, only_successful
        self._observation: Any = None

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        self.writer.discard_episode()
        self._observation, info = self.env.reset(**options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        seen = {
            key: np.array(value)
            for key, value in _values(self._observation, self.env.observation_space).items()
        }
        result = self.env.step(action)
        self._observation, reward, terminated, truncated, info = result
        action = np.asarray(action, dtype=np.float64)
        if isinstance(self.writer, LeRobotWriter):
            known = self.writer.features.keys()
            self.writer.add_frame(
                {
                    k: v.astype(np.float32) if v.dtype == np.float64 else v
                    for k, v in seen.items()
                    if k in known
                }
                | {"action": action.astype(np.float32)}
            )
        else:
            self.writer.add_frame(
                {_short(k): v for k, v in seen.items()}
                | {"actions": action, "rewards": float(reward)}
            )
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


def robomimic_observations(env: gym.Env) -> dict[str, Feature]:
    """Features of an environment's observations for a `RobomimicWriter`: `state`, `CAMERA_image`, `CAMERA_depth`."""
    kinds = {"u": "image", "f": str(np.dtype(np.float32))}
    return {
        _short(key): {"dtype": kinds[space.dtype.kind], "shape": space.shape, "names": None}
        for key, space in _leaves(env.observation_space)
    }


def robomimic_environment(env: gym.Env) -> dict[str, Any]:
    """What a `RobomimicWriter` writes down to make an environment anew: `env_name` and `env_kwargs`. It must be of `gym.make`."""
    if env.spec is None:
        raise ValueError(
            "env: it has no spec; make it by gym.make, or give env_name and env_kwargs yourself"
        )
    return {"env_name": env.spec.id, "env_kwargs": dict(env.spec.kwargs)}


def _short(key: str) -> str:
    words = key.removeprefix("observation.").split(".")
    return (
        f"{words[1]}_{'image' if words[0] == 'images' else words[0]}"
        if len(words) > 1
        else words[0]
    )
