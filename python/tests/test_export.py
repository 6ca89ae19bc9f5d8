"""Datasets that are rendered after the fact: what they hold, and that others read them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trocar
from trocar import campaign

pytest.importorskip("av")
h5py = pytest.importorskip("h5py")
pd = pytest.importorskip("pandas")

from trocar import export
from trocar.datasets import _video

#: Height and width of the pictures (px).
SIZE = (48, 64)


@pytest.fixture(scope="module")
def lifts(lift_scene, short_scene, tmp_path_factory):
    """A lift that passes, and an episode too short to pass, with surfaces."""
    folder = tmp_path_factory.mktemp("lifts")
    for scene, policy in ((lift_scene, "scripted"), (short_scene, "random")):
        options = {"episodes": 1, "variation": "none", "workers": 1, "surfaces": True}
        campaign.run(str(scene), [policy], folder / policy, **options)
    return folder


@pytest.fixture(scope="module")
def seen(lift_scene):
    """States, pictures, actions and rewards of the same lift in an environment."""
    import gymnasium as gym

    env = gym.make(
        "trocar/GraspLift-v0",
        scene=str(lift_scene),
        obs="state+rgb",
        cameras=("endoscope",),
        image_size=SIZE,
        variation="none",
    )
    expert = trocar.Policy("scripted")
    observation, _ = env.reset(seed=0)
    expert.reset(env)
    states, pictures = [observation["agent_pos"]], [observation["pixels"]["endoscope"]]
    actions, rewards, over = [], [], False
    while not over:
        actions.append(expert(env))
        observation, reward, ended, late, _ = env.step(actions[-1])
        states.append(observation["agent_pos"].copy())
        pictures.append(observation["pixels"]["endoscope"].copy())
        rewards.append(reward)
        over = ended or late
    env.close()
    return np.array(states), np.array(pictures), np.array(actions), np.array(rewards)


@pytest.fixture(scope="module")
def dataset(lifts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lerobot") / "dataset"
    made = export.export([lifts], folder, cameras=["endoscope"], size=SIZE)
    assert made["found"] == 2 and made["episodes"] == 1 and made["notes"] == []
    return folder


@pytest.fixture(scope="module")
def file(lifts, tmp_path_factory):
    path = tmp_path_factory.mktemp("robomimic") / "lifts.hdf5"
    export.export([lifts], path, layout="robomimic", cameras=["endoscope"], size=SIZE)
    return path


def test_a_lerobot_dataset_holds_what_an_environment_shows(dataset, seen, tmp_path):
    states, pictures, actions, _ = seen
    info = json.loads((dataset / "meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["fps"]) == (1, len(actions), 30)
    table = pd.concat(map(pd.read_parquet, sorted((dataset / "data").rglob("*.parquet"))))
    # The actions of the file are the policy's own doubles; the states those of the environment.
    assert np.array_equal(np.stack(table["observation.state"]), states[:-1])
    assert np.abs(np.stack(table["action"]) - actions).max() < 1e-6
    assert np.allclose(table["timestamp"], np.arange(len(actions)) / 30)
    video = _video.read(next((dataset / "videos").rglob("*.mp4")))
    assert video.shape == (len(actions), *SIZE, 3)
    # Nearer to a video of the environment's pictures than that is to them: the codec loses far more
    # than a few micrometres. The robomimic file below is without loss.
    _video.write(tmp_path / "seen.mp4", list(pictures[:-1]), 30)
    wanted = _video.read(tmp_path / "seen.mp4").astype(float)
    assert np.abs(video - wanted).mean() < 0.5 * np.abs(wanted - pictures[:-1]).mean()


def test_frames_of_demonstrations_say_who_moved_the_arms(lifts, tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    passed = next(lifts.rglob("scripted/000000"))
    for name in ("plain", "driven"):
        shutil.copytree(passed, tmp_path / "lifts" / name)
    # As `trocar view --record` writes them.
    (tmp_path / "lifts/driven/actors.csv").write_text("step,left,right\n")
    channels = tmp_path / "lifts/driven/channels.parquet"
    table = pq.read_table(channels)
    by_operator = np.arange(len(table)) % 3.0
    for column, values in (("left_actor", by_operator), ("right_actor", 0.0 * by_operator)):
        table = table.append_column(column, pa.array(values))
    pq.write_table(table, channels)
    export.export([tmp_path / "lifts"], tmp_path / "dataset", cameras=[])
    info = json.loads((tmp_path / "dataset/meta/info.json").read_text())
    assert info["features"]["actor"]["names"] == ["left_actor", "right_actor"]
    frames = pd.concat(map(pd.read_parquet, sorted((tmp_path / "dataset/data").rglob("*.parquet"))))
    driven, plain = (frames[frames["episode_index"] == k] for k in (0, 1))
    assert np.array_equal(np.stack(driven["actor"])[:, 0], by_operator)
    assert not np.stack(plain["actor"]).any()


def test_a_robomimic_file_holds_what_an_environment_shows(file, seen):
    states, pictures, actions, rewards = seen
    with h5py.File(file) as opened:
        data = opened["data"]
        kwargs = json.loads(data.attrs["env_args"])
        assert kwargs["env_name"] == "trocar/GraspLift-v0" and kwargs["env_kwargs"]["normalize"]
        assert list(data) == ["demo_0"] and data.attrs["total"] == len(actions)
        demo = data["demo_0"]
        assert demo.attrs["num_samples"] == len(actions) and demo.attrs["success"]
        assert np.array_equal(demo["obs/state"], states[:-1])
        assert np.array_equal(demo["next_obs/state"], states[1:])
        assert np.allclose(demo["rewards"], rewards, atol=1e-9)
        assert demo["dones"][:].tolist() == [0] * (len(actions) - 1) + [1]
        assert np.abs(demo["actions"]).max() <= 1.0 and np.ptp(demo["actions"]) > 0.5
        for key, wanted in (("obs", pictures[:-1]), ("next_obs", pictures[1:])):
            shown = demo[f"{key}/endoscope_image"][:]
            assert shown.shape == wanted.shape
            assert np.abs(shown.astype(float) - wanted).mean() < 0.05


def test_robomimic_reads_its_file(file, seen):
    robomimic = pytest.importorskip("robomimic.utils.dataset", reason="needs robomimic")
    read = robomimic.SequenceDataset(
        str(file), obs_keys=("state",), dataset_keys=("actions",), seq_length=4
    )
    assert len(read) == len(seen[2]) and read[0]["obs"]["state"].shape == (4, 47)


def test_what_did_not_pass_is_left_out_unless_it_is_asked_for(lifts, tmp_path):
    made = export.export([lifts], tmp_path / "all", cameras=[], failed=True)
    assert (made["episodes"], made["cameras"]) == (2, [])
    with pytest.raises(ValueError, match="none of 1 episodes passed; --all"):
        export.export([lifts / "random"], tmp_path / "none")


def test_wrong_requests_are_refused_by_name(lifts, dataset, tmp_path):
    with pytest.raises(ValueError, match="exists; choose another"):
        export.export([lifts], dataset)
    with pytest.raises(ValueError, match=r"has no episode\.trocar"):
        export.export([tmp_path], tmp_path / "out")
    with pytest.raises(ValueError, match="format: 'zarr' is unknown"):
        export.export([lifts], tmp_path / "out", layout="zarr")
    with pytest.raises(ValueError, match=r"cameras: 'mine' is unknown; .* has endoscope"):
        export.export([lifts], tmp_path / "out", cameras=["mine"])
    broken = tmp_path / "broken"
    shutil.copytree(lifts / "scripted/episodes/scripted/000000", broken)
    surfaces = bytearray((broken / "surfaces.trocar").read_bytes())
    surfaces[-40] ^= 1
    (broken / "surfaces.trocar").write_bytes(surfaces)
    for layout in export.LAYOUTS:
        with pytest.raises(ValueError, match=r"surfaces\.trocar: was changed after it was written"):
            export.export([lifts, broken], tmp_path / "out", layout=layout, size=SIZE)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["broken"]


def test_the_program_exports_and_an_episode_without_surfaces_is_replayed(
    lifts, file, program, tmp_path
):
    alone = tmp_path / "alone"
    shutil.copytree(lifts / "scripted/episodes/scripted/000000", alone)
    (alone / "surfaces.trocar").unlink()
    package = str(Path(trocar.__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": package, "TROCAR_PYTHON": sys.executable}
    words = [program, "export", alone, "-o", tmp_path / "out.hdf5", "--json", "--quiet"]
    words += ["--format", "robomimic"]
    words += ["--cameras", "endoscope", "--size", f"{SIZE[1]}x{SIZE[0]}"]
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["episodes"] == 1
    # The same pictures as of the surfaces that were kept while it ran.
    with h5py.File(file) as one, h5py.File(tmp_path / "out.hdf5") as other:
        for name in ("actions", "rewards", "obs/state", "obs/endoscope_image"):
            assert np.array_equal(*(f[f"data/demo_0/{name}"] for f in (one, other))), name
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert done.returncode == 2 and "exists; choose another" in done.stderr


def test_lerobot_reads_it_and_act_trains_and_loads(dataset, tmp_path):
    torch = pytest.importorskip("torch", reason="needs torch")
    pytest.importorskip("lerobot.policies.act", reason="needs lerobot")
    from lerobot.configs.types import FeatureType
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from lerobot.datasets.utils import dataset_to_policy_features
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy

    chunk = 8
    times = [k / 30 for k in range(chunk)]
    read = LeRobotDataset(
        "local/lifts", root=dataset, delta_timestamps={"action": times}, video_backend="pyav"
    )
    features = dataset_to_policy_features(read.meta.features)
    outputs = {k: f for k, f in features.items() if f.type is FeatureType.ACTION}
    config = ACTConfig(
        input_features={k: f for k, f in features.items() if k not in outputs},
        output_features=outputs,
        chunk_size=chunk,
        n_action_steps=chunk,
        dim_model=32,
        n_heads=2,
        dim_feedforward=32,
        n_encoder_layers=1,
        use_vae=False,
        pretrained_backbone_weights=None,
        device="cpu",
    )
    torch.manual_seed(0)
    policy = ACTPolicy(config)
    optimizer = torch.optim.AdamW(policy.parameters(), lr=1e-3)
    batch = torch.utils.data.default_collate([read[k] for k in (0, 20, 40, 60)])
    losses = []
    for _ in range(6):
        loss, _ = policy(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.8 * losses[0], losses
    policy.save_pretrained(tmp_path / "act")
    again = ACTPolicy.from_pretrained(tmp_path / "act")
    for mine in (policy, again):
        mine.eval()
    with torch.no_grad():
        one, other = (mine.predict_action_chunk(batch) for mine in (policy, again))
    assert torch.equal(one, other) and one.shape == (4, chunk, 10)
