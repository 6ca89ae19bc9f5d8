"""LeRobot's factory and evaluation run the environments and read task and success."""

import importlib.util
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import trocar

pytest.importorskip("lerobot.scripts.lerobot_eval")

import torch
from lerobot.envs.factory import make_env
from lerobot.envs.utils import close_envs
from lerobot.scripts.lerobot_eval import rollout

EXAMPLE = Path(__file__).parents[2] / "examples/python/evaluate_lerobot.py"


@pytest.fixture(scope="module")
def example():
    """The example as a module."""
    spec = importlib.util.spec_from_file_location("evaluate_lerobot", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look up their module.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class Still(torch.nn.Module):
    """A policy that stands still and keeps its observations."""

    def reset(self):
        self.shown = None

    def select_action(self, shown):
        self.shown = shown
        state = shown["observation.state"]
        return torch.cat([state[:, :5], state[:, 23:28]], dim=1)


class Expert(torch.nn.Module):
    """The scripted controller in each cell.

    LeRobot resets policies before environments, so it starts at its first action.
    """

    def __init__(self, envs):
        super().__init__()
        self.envs = envs

    def reset(self):
        self.experts = None

    def select_action(self, shown):
        if self.experts is None:
            self.experts = [trocar.Policy("scripted") for _ in self.envs]
            for expert, env in zip(self.experts, self.envs):
                expert.reset(env)
        return torch.from_numpy(
            np.stack([expert(env) for expert, env in zip(self.experts, self.envs)])
        )


def evaluated(env, policy, seeds):
    """The result of LeRobot's rollout, without warnings."""

    def same(value):
        return value

    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        return rollout(env, policy, same, same, same, same, seeds=seeds)


def test_the_factory_makes_environments_with_their_task(example):
    config = example.TrocarConfig(variation="none", episode_s=0.1, size=32, cameras=["d405"])
    envs = make_env(config, n_envs=2)
    env, policy = envs["trocar"][0], Still()
    given = evaluated(env, policy, [1, 2])
    assert (
        given["action"].shape == (2, 3, 10)
        and given["done"][:, -1].all()
        and not given["success"].any()
    )
    assert (
        policy.shown["task"] == [env.envs[0].task_description] * 2
        and "appendix" in policy.shown["task"][0]
    )
    assert policy.shown["observation.images.d405"].shape == (2, 3, 32, 32)
    assert env.envs[0].render().shape == (32, 32, 3) and env.unwrapped.metadata["render_fps"] == 30
    wanted = {name: feature.shape for name, feature in config.features.items()}
    assert wanted["agent_pos"] == env.single_observation_space["agent_pos"].shape
    assert wanted["action"] == env.single_action_space.shape
    close_envs(envs)


def test_success_is_read_from_one_cell_and_from_many(example):
    alone = make_env(example.TrocarConfig(variation="none", cameras=[], episode_s=20.0), n_envs=1)[
        "trocar"
    ][0]
    many = trocar.TrocarVectorEnv(
        2,
        task="grasp-lift",
        obs="agent_pos",
        episode_s=20.0,
        variation="none",
        autoreset_mode="same-step",
    )
    for env, seeds in [(alone, [0]), (many, [0, 1])]:
        given = evaluated(env, Expert(env.envs), seeds)
        assert given["success"].any(dim=1).all(), (
            "the scripted controller passes, and LeRobot sees it"
        )
        env.close()
