"""The example that learns from pictures, from recorded episodes to a campaign, on tiny data."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import changed_scene

from trocar import campaign

torch = pytest.importorskip("torch")
pytest.importorskip("av")
pytest.importorskip("matplotlib")
pytest.importorskip("pandas")
pytest.importorskip("websockets")

EXAMPLES = Path(__file__).parents[2] / "examples/python"


def run(name, *arguments):
    """Runs an example and returns what it printed."""
    # The package is on the path of this process, not always on that of a child.
    package = str(Path(campaign.__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": package}
    words = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Two disturbed demonstrations, of which the second was recorded by a second call."""
    folder = tmp_path_factory.mktemp("demonstrations") / "lifts"
    for episodes in (1, 2):
        words = ["--cameras", "endoscope", "--size", 32, "--noise", 0.3, "--seconds", 9]
        run("record_demonstrations.py", "--episodes", episodes, *words, "-o", folder)
    return folder


@pytest.fixture(scope="module")
def cloned(dataset, tmp_path_factory):
    """A folder with policies of a few steps of training."""
    folder = tmp_path_factory.mktemp("cloned")
    for observe in ("pictures", "states"):
        words = ["--observe", observe, "--seeds", 0, "--steps", 40, "--batch", 16]
        run("train_from_pictures.py", dataset, *words, "-o", folder)
    return folder


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location(
        "train_from_pictures", EXAMPLES / "train_from_pictures.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_recording_is_continued_and_leaves_the_noise_out_of_the_actions(dataset):
    seeds = json.loads(dataset.with_name("lifts.seeds.json").read_text())
    info = json.loads((dataset / "meta/info.json").read_text())
    assert [seed for seed, _ in seeds] == [0, 1]
    assert info["total_episodes"] == sum(passed for _, passed in seeds) > 0


def test_recording_stops_once_enough_have_passed(dataset):
    log = dataset.with_name("lifts.seeds.json")
    before = log.read_text()
    words = ["--cameras", "endoscope", "--size", 32, "--noise", 0.3, "--seconds", 9]
    told = run("record_demonstrations.py", "--episodes", 9, "--keep", 1, *words, "-o", dataset)
    assert log.read_text() == before
    assert "of 2 passed" in told


@pytest.mark.parametrize("observe", ["pictures", "states"])
def test_the_loss_on_held_out_frames_falls(cloned, observe):
    rows = np.loadtxt(cloned / f"{observe}_0.csv", delimiter=",")
    assert rows[-1, 3] < 0.8 * rows[0, 3]


def test_the_same_seed_gives_the_same_weights(example, dataset, cloned):
    data = example.Demonstrations(dataset, "states")
    torch.set_num_threads(2)
    net, _ = example.train(data, "states", 0, 40, 16)
    kept = torch.load(cloned / "states_0.pt", weights_only=True)["net"]
    assert all(torch.equal(kept[name], value) for name, value in net.state_dict().items())


def test_targets_after_the_end_of_an_episode_do_not_count(example, dataset):
    data = example.Demonstrations(dataset, "states")
    assert data.counts[data.train[-1]].tolist() == [True] + [False] * (example.HORIZON - 1)
    assert data.counts[data.train[0]].all()


def test_the_rise_begins_where_the_jaws_take_hold(example):
    rise, state = example.Rise(), np.zeros(47, np.float32)
    heights = []
    for holds, height in [(0, 1.0), (1, 2.0), (1, 2.5), (0, 2.5), (1, 3.0), (1, 3.25)]:
        state[example.HOLDS], state[example.HEIGHT] = holds, height
        heights.append(float(rise.numbers(state)[-1]))
    assert heights == [0.0, 0.0, 0.5, 0.0, 0.0, 0.25]


@pytest.mark.skipif(
    "TROCAR_REALTIME" not in os.environ,
    reason="runs in real time: set TROCAR_REALTIME=1 on an idle machine",
)
def test_the_whole_way_from_an_operator_to_a_table_is_one_command(program, tmp_path):
    out = tmp_path / "lifts"
    told = run("demonstrations.py", "--quick", "--program", program, "-o", out)
    assert "2 of 2 kept" in told and told.count("--verify") == 2
    result = json.loads((out / "campaign/result.json").read_text())
    assert [row["policy"] for row in result["policies"]] == ["cloned", "scripted", "noise"]


def test_a_cloned_policy_runs_in_a_campaign(cloned, tmp_path):
    scene = changed_scene(tmp_path, "grasp-lift", 0.6)
    names = ["pictures_0", "states_0"]
    policies = [f"{name}=python:{cloned / 'policies.py'}:{name}" for name in names]
    result = campaign.run(str(scene), policies, tmp_path / "out", episodes=1, variation="none")
    for row in result["policies"]:
        assert row["ends"]["policy-error"] == 0 and row["ends"]["time-out"] == 1
