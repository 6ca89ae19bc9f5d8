"""robomimic files: their content, and that they are complete whatever happens to the writer."""

import json
import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

h5py = pytest.importorskip("h5py")
pytest.importorskip("pyarrow")
pytest.importorskip("av")

from trocar.datasets import RobomimicWriter, _spare, robomimic_environment

OBSERVATIONS = {
    "state": {"dtype": "float32", "shape": (3,)},
    "endoscope_image": {"dtype": "image", "shape": (16, 24, 3)},
}
LENGTHS = [7, 12, 5]
NAME = "trocar/GraspLift-v0"


def picture(episode, frame):
    return np.random.default_rng([episode, frame]).integers(0, 255, (16, 24, 3)).astype(np.uint8)


def opened(path, **changed):
    options = {
        "observations": OBSERVATIONS,
        "actions": 2,
        "env_name": NAME,
        "env_kwargs": {"obs": "state+rgb", "image_size": (16, 24)},
    }
    return RobomimicWriter(path, **options | changed)


def fill(writer, episode):
    for k in range(LENGTHS[episode]):
        frame = {"state": np.full(3, k, np.float32), "endoscope_image": picture(episode, k)}
        writer.add_frame(frame | {"actions": np.array([k, 1.0]), "rewards": float(k)})


def last(episode):
    return {"state": np.full(3, 99, np.float32), "endoscope_image": picture(episode, 99)}


def save(writer, episode):
    fill(writer, episode)
    return writer.save_episode(last(episode), success=episode == 1)


def check(path, episodes):
    """Asserts that the file holds the first `episodes` episodes completely and nothing else."""
    with h5py.File(path, "r") as file:
        data = file["data"]
        assert sorted(data) == [f"demo_{k}" for k in range(episodes)]
        assert data.attrs["total"] == sum(LENGTHS[:episodes])
        assert (
            [name.decode() for name in file["mask/train"][:]] == sorted(data)
            if episodes
            else "mask" not in file
        )
        for k in range(episodes):
            demo = data[f"demo_{k}"]
            assert demo.attrs["num_samples"] == LENGTHS[k] and demo.attrs["success"] == (k == 1)
            assert demo["dones"][:].tolist() == [0] * (LENGTHS[k] - 1) + [1]
            assert (
                demo["rewards"][:].tolist()
                == demo["actions"][:, 0].tolist()
                == list(range(LENGTHS[k]))
            )
            assert demo["obs/state"][:, 0].tolist() == list(range(LENGTHS[k]))
            assert demo["next_obs/state"][:, 0].tolist() == [*range(1, LENGTHS[k]), 99]
            seen = [picture(k, n) for n in [*range(LENGTHS[k]), 99]]
            assert np.array_equal(demo["obs/endoscope_image"], seen[:-1])
            assert np.array_equal(demo["next_obs/endoscope_image"], seen[1:])


def test_the_file_has_the_content_that_robomimic_reads(tmp_path):
    path = tmp_path / "new/set.hdf5"
    for part in ([0, 1], [2]):
        with opened(path) as writer:
            for episode in part:
                assert save(writer, episode) == episode
                check(path, episode + 1)
        assert os.listdir(path.parent) == ["set.hdf5"]
    with h5py.File(path) as file:
        # robomimic's EnvType.GYM_TYPE is 2; 1 is robosuite.
        known = {
            "env_name": NAME,
            "type": 2,
            "env_kwargs": {"obs": "state+rgb", "image_size": [16, 24]},
        }
        assert json.loads(file["data"].attrs["env_args"]) == known


def test_every_tenth_is_for_validation_and_other_masks_are_continued(tmp_path):
    path = tmp_path / "set.hdf5"
    writer = opened(path)
    for _ in range(11):
        save(writer, 0)
    with h5py.File(path, "a") as file:
        assert file["mask/valid"][:].tolist() == [b"demo_9"] and len(file["mask/train"]) == 10
        # As robomimic's script does.
        del file["mask/train"]
        file["mask/train"] = np.array(["demo_9", "demo_8"], dtype="S")
    assert save(writer, 0) == 11
    with h5py.File(path) as file:
        assert file["mask/train"][:].tolist() == [b"demo_9", b"demo_8", b"demo_11"]
        assert len(file["data"]) == 12 and file["data"].attrs["total"] == 12 * LENGTHS[0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a fork dies at each write")
def test_a_kill_at_any_write_loses_no_saved_episode(tmp_path, monkeypatch):
    base, real = tmp_path / "base.hdf5", h5py.File
    with opened(base) as writer:
        save(writer, 0)
    # Every third write: HDF5 writes a demonstration in many small pieces.
    for kill in range(0, 1000, 3):
        path, log = tmp_path / f"{kill}/set.hdf5", tmp_path / f"{kill}.log"
        path.parent.mkdir()
        path.write_bytes(base.read_bytes())
        child = os.fork()
        if child == 0:
            try:
                die_at(kill, monkeypatch)
                writer = opened(path)
                for episode in (1, 2):
                    save(writer, episode)
                    log.write_text(str(episode + 1))
                writer.close()
            except BaseException as why:
                log.write_text(repr(why))
                os._exit(1)
            os._exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert status in (0, DEAD), log.read_text()
        returned = int(log.read_text()) if log.exists() else 1
        with real(path, "r") as file:
            held = len(file["data"])
        assert returned <= held <= returned + 1
        check(path, held)
        # The killed writer's files are removed, and the continued file is as without the kill.
        with opened(path) as writer:
            assert os.listdir(path.parent) == ["set.hdf5"]
            for episode in range(held, 3):
                save(writer, episode)
        check(path, 3)
        assert os.listdir(path.parent) == ["set.hdf5"]
        if status == 0:
            assert kill > 50
            return
    raise AssertionError("the loop ends when the child finishes")


#: Exit status of a killed child.
DEAD = 9


def die_at(kill, monkeypatch):
    """Makes this process exit before its write, link, replacement or removal number `kill`."""
    left = [kill]

    def counted(function):
        def call(*given, **named):
            if left[0] == 0:
                os._exit(DEAD)
            left[0] -= 1
            return function(*given, **named)

        return call

    class Disk:
        """HDF5 writes through this, in the order in which it writes to a disk."""

        def __init__(self, path, mode):
            self.file = open(path, "w+b" if mode == "w" else "r+b", buffering=0)
            self.write = counted(self.file.write)

        def __getattr__(self, name):
            return getattr(self.file, name)

    def through(path, mode):
        return (
            real(path, "r") if mode == "r" else real(Disk(path, mode), "w" if mode == "w" else "r+")
        )

    real = h5py.File
    monkeypatch.setattr(h5py, "File", through)
    for name in ("link", "replace", "unlink"):
        monkeypatch.setattr(os, name, counted(getattr(os, name)))
    monkeypatch.setattr(_spare.shutil, "copy", counted(_spare.shutil.copy))


def test_the_cost_of_an_episode_does_not_depend_on_earlier_ones(tmp_path, monkeypatch):
    copied, copy = [], _spare.shutil.copy
    monkeypatch.setattr(
        _spare.shutil, "copy", lambda a, b: (copied.append(os.path.getsize(a)), copy(a, b))
    )
    path = tmp_path / "set.hdf5"
    with opened(path) as writer:
        for _ in range(12):
            save(writer, 0)
    # Copied once, when the file was empty.
    assert len(copied) == 1 and copied[0] < 10_000
    with opened(path) as writer:
        for _ in range(12):
            save(writer, 0)
    assert len(copied) == 2


def test_readers_keep_the_file_that_they_opened(tmp_path):
    path = tmp_path / "set.hdf5"
    writer = opened(path)
    save(writer, 0)
    read = (
        "import h5py,sys; f = h5py.File(sys.argv[1], 'r'); print(1, flush=True); input();"
        "print(len(f['data']), f['data/demo_0/obs/endoscope_image'][-1].sum())"
    )
    reader = subprocess.Popen(
        [sys.executable, "-c", read, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert reader.stdout.readline() == "1\n"
    with h5py.File(path, "r"):
        save(writer, 1)
        save(writer, 2)
    assert reader.communicate("\n")[0].split() == [
        "1",
        str(picture(0, LENGTHS[0] - 1).sum(dtype=int)),
    ]
    check(path, 3)


def test_a_wrong_last_observation_changes_nothing(tmp_path):
    path = tmp_path / "set.hdf5"
    writer = opened(path)
    fill(writer, 0)
    good = last(0)
    for wrong, words in [
        ({"state": good["state"]}, "last: endoscope_image missing"),
        (good | {"more": 1}, "last: more unknown"),
        (good | {"state": np.zeros(4)}, r"last: state has shape \(4,\)"),
        (good | {"state": np.full(3, np.nan)}, "last: state has a number that is not finite"),
        (good | {"endoscope_image": np.zeros((16, 24, 3))}, "last: endoscope_image is float64"),
    ]:
        with pytest.raises(ValueError, match=words):
            writer.save_episode(wrong)
        check(path, 0)
    # The frames are kept.
    assert writer.save_episode(good) == 0
    check(path, 1)


def test_an_episode_is_written_again_after_an_error(tmp_path, monkeypatch):
    path = tmp_path / "set.hdf5"
    writer = opened(path)
    save(writer, 0)
    create, full = h5py.Group.create_dataset, [True]

    def once(self, name, **given):
        if name == "next_obs/state" and full.pop():
            raise OSError("no space left")
        return create(self, name, **given)

    monkeypatch.setattr(h5py.Group, "create_dataset", once)
    fill(writer, 1)
    with pytest.raises(OSError, match="no space"):
        writer.save_episode(last(1), success=True)
    monkeypatch.setattr(h5py.Group, "create_dataset", create)
    check(path, 1)
    assert writer.save_episode(last(1), success=True) == 1
    # Without hard links (some network and memory-card file systems) it is slower and correct.
    monkeypatch.setattr(
        os, "link", lambda a, b: (_ for _ in ()).throw(PermissionError("no links here"))
    )
    assert save(writer, 2) == 2
    check(path, 3)


def test_two_writers_of_a_file_take_turns(tmp_path):
    path = tmp_path / "set.hdf5"
    one, other = opened(path), opened(path)
    assert [save(one, 0), save(other, 1)] == [0, 1]
    other.close()
    assert save(one, 2) == 2 and one.episodes == other.episodes == 3
    check(path, 3)
    # While one saves, the end of another removes nothing.
    with one._spare.locked():
        one._spare.copy()
        other.close()
        assert one._spare.path.exists()


def test_only_a_fitting_file_is_continued(tmp_path):
    path = tmp_path / "set.hdf5"
    save(opened(path), 0)
    for change, words in [
        ({"actions": 3}, "other observations or actions"),
        ({"observations": {"state": OBSERVATIONS["state"]}}, "other observations or actions"),
        ({"env_name": "trocar/PortReach-v0"}, "another environment"),
        ({"env_kwargs": {"obs": "rgb"}}, "another environment"),
        ({"env_kwargs": {"obs": object()}}, "env_kwargs: .* not JSON"),
        ({"observations": {"word": {"dtype": "string", "shape": (1,)}}}, "word has dtype 'string'"),
        (
            {"observations": {"actions": OBSERVATIONS["state"]}},
            "actions: the writer adds these itself",
        ),
    ]:
        with pytest.raises(ValueError, match=words):
            opened(path, **change)
    with h5py.File(tmp_path / "foreign.hdf5", "w") as file:
        file["letter"] = "dear"
    with pytest.raises(ValueError, match="not a robomimic file"):
        opened(tmp_path / "foreign.hdf5")
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(OSError, match=r"letter\.txt cannot be opened as HDF5"):
        opened(tmp_path / "letter.txt")
    check(path, 1)


def test_the_environment_is_that_of_its_spec():
    env = gym.make("CartPole-v1", sutton_barto_reward=True)
    assert robomimic_environment(env) == {
        "env_name": "CartPole-v1",
        "env_kwargs": {"sutton_barto_reward": True},
    }
    with pytest.raises(ValueError, match="no spec"):
        robomimic_environment(gym.Env())
