"""Fixtures of several files. Cells are built once, because building one takes about a second."""

import os
import shutil
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import trocar  # noqa: F401  (registers the environments)

#: Short episodes of the fixed cell are enough for tests of the contract.
SHORT = {"episode_s": 0.4, "variation": "none"}


@pytest.fixture(scope="session")
def one():
    """One cell that lifts."""
    return gym.make("trocar/GraspLift-v0", **SHORT)


@pytest.fixture(scope="session")
def seeing():
    """One cell with state, colours and depth of two cameras."""
    return gym.make(
        "trocar/GraspLift-v0",
        obs="state+rgb+depth",
        image_size=(48, 64),
        render_mode="rgb_array",
        **SHORT,
    )


@pytest.fixture(scope="session")
def program():
    """The program `trocar`: `$TROCAR_PROGRAM`, or cargo's build, or the one on the path."""
    built = Path(__file__).parents[2] / "target/release/trocar"
    found = os.environ.get("TROCAR_PROGRAM") or (
        str(built) if built.exists() else shutil.which("trocar")
    )
    if not found:
        pytest.skip("the program is not built (cargo build --release)")
    return found


def changed_scene(folder, task, seconds):
    """The built-in scene as a file, with another task, another duration (s) and small pictures."""
    text = (Path(__file__).parents[2] / "crates/scene/scenes/cell-a.toml").read_text()
    for old, new in [
        ('name = "appendix-resection"', f'name = "{task}"'),
        ("episode_s = 40.0", f"episode_s = {seconds}"),
        ("policy_size_px = [224, 224]", "policy_size_px = [48, 48]"),
    ]:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{task}.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="session")
def short_scene(tmp_path_factory):
    """A scene file of port-reach with episodes of half a second."""
    return changed_scene(tmp_path_factory.mktemp("scene"), "port-reach", 0.5)


@pytest.fixture(scope="session")
def lift_scene(tmp_path_factory):
    """A scene file of grasp-lift with enough time to pass."""
    return changed_scene(tmp_path_factory.mktemp("scene"), "grasp-lift", 20.0)


def rollout(env, seed, actions):
    """Observations, rewards and hashes of an episode."""
    seen, _ = env.reset(seed=seed)
    all_seen, rewards, hashes = [seen], [], []
    for action in actions:
        seen, reward, ended, late, _ = env.step(action)
        all_seen.append(seen)
        rewards.append(reward)
        hashes.append(env.unwrapped.state_hash)
        if ended or late:
            break
    return np.array(all_seen), np.array(rewards), hashes


def actions_of(env, seed, count):
    dice = np.random.default_rng(seed)
    low, high = env.action_space.low, env.action_space.high
    return [dice.uniform(low, high).astype(np.float32) for _ in range(count)]
