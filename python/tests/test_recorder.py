"""A recorder writes its environment's observations, at its rate."""

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("av")
h5py = pytest.importorskip("h5py")

from trocar.datasets import (
    LeRobotWriter,
    Recorder,
    RobomimicWriter,
    features_of,
    robomimic_observations,
)


class Still(gym.Env):
    """An environment with two steps an episode that observes the number of steps."""

    metadata = {"render_modes": [], "render_fps": 60}
    observation_space = gym.spaces.Box(0, 9, (1,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (2,), np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.count += 1
        return np.full(1, self.count, np.float32), 0.5, self.count == 2, False, {"is_success": True}


def test_a_recorder_needs_the_rate_of_its_environment(tmp_path):
    env = Still()

    def writer(fps):
        return LeRobotWriter(tmp_path / f"set-{fps}", fps=fps, features=features_of(env))

    with pytest.raises(
        ValueError,
        match=r"the writer has 30, the environment runs 60 steps a second; .*with fps=60",
    ):
        Recorder(env, writer(30))
    # The environment's metadata count, not its class's.
    env.metadata = Still.metadata | {"render_fps": 30}
    env = Recorder(gym.wrappers.TimeLimit(env, 9), writer(30))
    env.reset(seed=0)
    for _ in range(2):
        env.step(np.zeros(2))
    assert env.writer.episodes == 1

    class EverySecond(gym.Wrapper):
        """Two steps in one."""

        metadata = {"render_modes": [], "render_fps": 15}

    Recorder(EverySecond(env.unwrapped), writer(15))
    with pytest.raises(ValueError, match="the environment runs 15"):
        Recorder(EverySecond(env.unwrapped), writer(30))


def test_a_recorder_feeds_a_robomimic_file(tmp_path):
    env = Still()
    with RobomimicWriter(
        tmp_path / "set.hdf5",
        observations=robomimic_observations(env),
        actions=2,
        env_name="Still-v0",
    ) as writer:
        recorder = Recorder(env, writer)
        for seed in range(2):
            recorder.reset(seed=seed)
            for _ in range(2):
                recorder.step(np.ones(2))
    with h5py.File(tmp_path / "set.hdf5") as file:
        demo = file["data/demo_1"]
        assert demo["obs/state"][:].tolist() == [[0], [1]] and demo["next_obs/state"][
            :
        ].tolist() == [[1], [2]]
        assert demo["rewards"][:].tolist() == [0.5, 0.5] and demo.attrs["success"]
