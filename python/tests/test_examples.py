"""Code of examples and guides, without the other packages that they need."""

import importlib.util
import json
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from trocar import campaign

ROOT = Path(__file__).parents[2]


class Anything(types.ModuleType):
    """A module with a class of every name."""

    __path__: list[str] = []

    def __getattr__(self, name):
        return type(name, (), {}) if name[0].isupper() else lambda *_, **__: None


@pytest.fixture
def learning(monkeypatch):
    """The learning example, with or without Stable-Baselines3."""
    names = [
        "common",
        "common.buffers",
        "common.callbacks",
        "common.torch_layers",
        "common.vec_env",
    ]
    for name in [
        "torch",
        "matplotlib",
        "matplotlib.pyplot",
        "stable_baselines3",
        *(f"stable_baselines3.{n}" for n in names),
    ]:
        monkeypatch.setitem(sys.modules, name, Anything(name))
    spec = importlib.util.spec_from_file_location(
        "train_grasp_lift", ROOT / "examples/python/train_grasp_lift.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("episodes", [4, 9, 10])
def test_the_test_of_the_learned_policy_takes_equally_many_episodes_of_each_cell(
    learning, monkeypatch, episodes
):
    class Cells:
        """Cell 0 always passes, after a step; cells 1 and 2 never do, after ten."""

        def __init__(self, *_, **__):
            self.steps = 0

        def reset(self):
            return np.zeros((3, 1))

        def step_async(self, actions):
            self.steps += 1

        def step_wait(self):
            over = np.array([True, self.steps % 10 == 0, self.steps % 10 == 0])
            return np.zeros((3, 1)), np.zeros(3), over, [{"is_success": k == 0} for k in range(3)]

    monkeypatch.setattr(learning, "LiftCells", Cells)
    model = types.SimpleNamespace(predict=lambda seen, deterministic: (np.zeros((3, 5)), None))
    options = types.SimpleNamespace(cells=3, test=episodes)
    passed = learning.test(model, options)
    assert len(passed) == episodes and sum(passed) == -(-episodes // 3)


def test_the_policy_of_the_guide_runs(short_scene, tmp_path):
    """It is served as it is written there, without the server of another package."""
    pytest.importorskip("msgpack")
    pytest.importorskip("websockets")
    text = (ROOT / "docs/guides/policies.md").read_text()
    (code,) = [block.partition("```")[0] for block in text.split("```python\n")[1:]]
    kept = [
        line
        for line in code.splitlines()
        if "openpi_server" not in line and not line.startswith("WebsocketPolicyServer")
    ]
    (tmp_path / "still.py").write_text("\n".join(kept))
    policy = f"still=python:{tmp_path / 'still.py'}:Still"
    result = campaign.run(
        str(short_scene), [policy], tmp_path / "out", episodes=1, variation="none"
    )
    (row,) = result["policies"]
    kept = json.loads((tmp_path / "out/episodes/still/000000/result.json").read_text())
    assert row["ends"]["policy-error"] == 0, kept["end"]
