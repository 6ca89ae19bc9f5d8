"""Campaigns give the same bits on threads and on Ray, and resume after a stop."""

import io
import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from trocar import _ray, _threads, campaign
from trocar._progress import LOG_INTERVAL_S, Bar

OPTIONS = {"episodes": 2, "seed": 5, "variation": "none"}
POLICIES = ["scripted", "random"]

#: A policy that blocks when it acts, or with $LOADS_SLOWLY when it is loaded.
WAITED_FOR = """
import os, pathlib, sys, time

def wait(*_):
    pathlib.Path("asked.partial").write_text(str(os.getpid()))
    os.rename("asked.partial", "asked")
    time.sleep(600)

if os.environ.get("LOADS_SLOWLY"):
    wait()
"""


@pytest.fixture(scope="module")
def local(short_scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return folder, campaign.run(str(short_scene), POLICIES, folder / "local", workers=2, **OPTIONS)


def test_threads_keep_every_episode_and_resume(short_scene, local):
    folder, result = local
    assert result["episodes"] == result["planned"] == 4 and [
        p["episodes"] for p in result["policies"]
    ] == [2, 2]
    assert (folder / "local/report.html").exists() and (folder / "local/table.csv").exists()
    # One episode is missing: one is run, with the same bits.
    gone = folder / "local/episodes/random/000001"
    for file in gone.iterdir():
        file.unlink()
    gone.rmdir()
    done = []
    again = campaign.run(
        str(short_scene),
        POLICIES,
        folder / "local",
        workers=1,
        progress=lambda *n: done.append(n),
        **OPTIONS,
    )
    assert done == [(0, 1), (1, 1)] and again["hash"] == result["hash"]
    with pytest.raises(ValueError, match="another seed"):
        campaign.run(str(short_scene), POLICIES, folder / "local", **(OPTIONS | {"seed": 6}))
    with pytest.raises(ValueError, match="another split"):
        campaign.run(str(short_scene), POLICIES, folder / "local", **OPTIONS, split="unseen")
    with pytest.raises(ValueError, match=r"--by modulous: .*did you mean 'modulus'"):
        campaign.run(str(short_scene), POLICIES, folder / "new", **OPTIONS, by=["modulous"])


def test_ray_gives_the_same_bits_with_a_lost_worker(short_scene, local, monkeypatch):
    pytest.importorskip("ray", reason="Ray is not installed")
    folder, result = local
    mark = folder / "lost"

    class Mortal(_ray.Actor):
        """Its first process dies amid an episode."""

        def run(self, job):
            if not mark.exists():
                mark.touch()
                os._exit(1)
            return super().run(job)

    monkeypatch.setattr(_ray, "Actor", Mortal)
    done = []
    options = {
        "workers": 2,
        "ray_address": "local",
        "progress": lambda *n: done.append(n),
        **OPTIONS,
    }
    far = campaign.run(str(short_scene), POLICIES, folder / "far", **options)
    assert mark.exists() and far["hash"] == result["hash"] and done[-1] == (4, 4)
    for kept in sorted((folder / "local/episodes").rglob("episode.trocar")):
        other = folder / "far" / kept.relative_to(folder / "local")
        assert kept.read_bytes() == other.read_bytes()
        assert (
            kept.with_name("result.json").read_text() == other.with_name("result.json").read_text()
        )


BUSY_CLUSTER = """
import sys
import ray
from trocar import campaign

ray.init(num_cpus=2, log_to_driver=False, include_dashboard=False)

@ray.remote(num_cpus=1)
class Other:
    def here(self):
        pass

other = Other.remote()
ray.get(other.here.remote())
result = campaign.run(sys.argv[1], ["random"], sys.argv[2], episodes=3, workers=2,
                      ray_address="local", variation="none")
print("episodes", result["episodes"])
"""


def test_on_ray_no_episode_waits_for_a_worker_that_does_not_start(short_scene, tmp_path):
    """Another actor occupies one of the cluster's two CPUs."""
    pytest.importorskip("ray", reason="Ray is not installed")
    command = [sys.executable, "-c", BUSY_CLUSTER, str(short_scene), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    assert "episodes 3" in done.stdout, done.stderr


def test_on_ray_a_policy_that_cannot_be_loaded_is_one_line(short_scene, tmp_path):
    pytest.importorskip("ray", reason="Ray is not installed")
    with pytest.raises(RuntimeError, match=r"no file .*nowhere\.py") as told:
        campaign.run(
            str(short_scene),
            ["python:nowhere.py:act"],
            tmp_path / "out",
            episodes=1,
            variation="none",
            ray_address="local",
            workers=1,
        )
    assert "\n" not in str(told.value)


def ends(process, seconds):
    """Whether a process ends within the time. A zombie has ended."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            with open(f"/proc/{process}/stat") as file:
                if file.read().rpartition(")")[2].split()[0] in "ZX":
                    return True
        except FileNotFoundError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
@pytest.mark.parametrize("how", ["acts", "loads", "ray"])
def test_ctrl_c_ends_a_campaign_that_waits_for_a_policy(short_scene, tmp_path, how):
    if how == "ray":
        pytest.importorskip("ray", reason="Ray is not installed")
    (tmp_path / "mine.py").write_text(WAITED_FOR)
    # If it blocks when it acts, the first episode is of `random` and is kept.
    named = ["random", "w=python:mine.py:wait"] if how == "acts" else ["w=python:mine.py:wait"]
    words = [word for policy in named for word in ("--policy", policy)] + (
        ["--ray", "local"] if how == "ray" else []
    )
    command = [
        sys.executable,
        "-m",
        "trocar.campaign",
        str(short_scene),
        *words,
        "--episodes",
        "2",
        "--variation",
        "none",
        "--workers",
        "1",
        "-o",
        "out",
    ]
    environment = {name: value for name, value in os.environ.items() if name != "TROCAR_PYTHON"}
    if how == "loads":
        environment["LOADS_SLOWLY"] = "1"
    started = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    )
    try:
        asked = tmp_path / "asked"
        begun = time.monotonic()
        while not asked.exists():
            assert started.poll() is None, started.stderr.read()
            assert time.monotonic() - begun < 120
            time.sleep(0.05)
        served = int(asked.read_text())
        started.send_signal(signal.SIGINT)
        _, said = started.communicate(timeout=30)
    finally:
        started.kill()
    assert started.returncode == 130, said
    assert said.strip().splitlines()[-1].startswith("interrupted;") and "Traceback" not in said
    assert ends(served, 10)
    kept = [
        str(p.parent.relative_to(tmp_path / "out/episodes"))
        for p in (tmp_path / "out/episodes").rglob("result.json")
    ]
    assert kept == (["random/000000"] if how == "acts" else [])
    if how == "loads":
        assert not (tmp_path / "out").exists(), "nothing was started"
        return
    # Table and page show the kept episodes.
    assert len((tmp_path / "out/table.csv").read_text().splitlines()) == 1 + len(kept)
    assert (tmp_path / "out/report.html").exists()


def test_python_policies_are_served_by_this_interpreter_and_nothing_stays_set(
    short_scene, tmp_path, monkeypatch
):
    pytest.importorskip("msgpack")
    monkeypatch.delenv("TROCAR_PYTHON", raising=False)
    monkeypatch.setenv("PATH", "/nowhere")
    (tmp_path / "who.py").write_text(
        "import pathlib, sys\n"
        "pathlib.Path(__file__).with_suffix('.txt').write_text(sys.executable)\n"
        "def act(obs):\n    s = obs['observation/state']\n    return [*s[:5], *s[23:28]]\n"
    )
    before = dict(os.environ)
    result = campaign.run(
        str(short_scene),
        [f"w=python:{tmp_path}/who.py:act"],
        tmp_path / "out",
        episodes=1,
        variation="none",
    )
    assert (
        result["policies"][0]["ends"]["policy-error"] == 0
        and (tmp_path / "who.txt").read_text() == sys.executable
    )
    assert dict(os.environ) == before


@pytest.mark.parametrize(
    "policy, said",
    [
        ("python:nowhere.py:act", "nowhere.py"),
        ("python:nowhere:act", "nowhere"),
        ("python:os:act", "no act in os"),
    ],
)
def test_a_policy_that_cannot_be_loaded_stops_the_campaign_before_anything_is_built(
    short_scene, tmp_path, monkeypatch, policy, said, capfd
):
    pytest.importorskip("msgpack")
    monkeypatch.setenv("TROCAR_PHANTOMS", str(tmp_path / "phantoms"))
    words = ["--policy", "random", "--policy", policy, "--workers", "1"]
    code = campaign.main([str(short_scene), *words, "-o", str(tmp_path / "out")])
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert code == 1 and line.startswith(f"error: {policy}: cannot be loaded: ") and said in line
    assert os.listdir(tmp_path) == []


def test_a_campaign_that_fails_before_its_first_episode_leaves_no_folder(
    short_scene, tmp_path, monkeypatch
):
    class Broken(Idle):
        def __init__(self, *_, **__):
            raise ValueError("no cell")

    monkeypatch.setattr(_threads, "Worker", Broken)
    with pytest.raises(ValueError, match="no cell"):
        campaign.run(str(short_scene), ["random"], tmp_path / "out", episodes=1, variation="none")
    assert not (tmp_path / "out").exists()


class Kept:
    """A campaign that remembers its episodes."""

    plan = "{}"

    def __init__(self):
        self.files = {}

    def put(self, job, files):
        self.files[job] = files


class Idle:
    """A worker that does nothing."""

    def __init__(self, *_, **__):
        pass

    def start(self, jobs):
        pass

    def run(self, job):
        return [job]


def test_workers_are_built_in_parallel(monkeypatch):
    both = threading.Barrier(2, timeout=20.0)

    class Worker(Idle):
        def __init__(self, *_, **__):
            both.wait()

    monkeypatch.setattr(_threads, "Worker", Worker)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    kept, told = Kept(), []
    _threads.run_on_threads(kept, "scene", ["a", "b", "c"], 2, lambda *n: told.append(n))
    assert kept.files == {"a": ["a"], "b": ["b"], "c": ["c"]} and told == [(k, 3) for k in range(4)]


def test_an_episode_that_has_finished_when_it_stops_is_kept(monkeypatch):
    """Ctrl-C comes when one episode is kept and another has finished."""
    over = threading.Event()

    class Worker(Idle):
        def run(self, job):
            if job == "b":
                time.sleep(0.2)
                over.set()
            return [job]

    def stops(done, _):
        if done == 1:
            assert over.wait(20.0)
            raise KeyboardInterrupt

    monkeypatch.setattr(_threads, "Worker", Worker)
    kept = Kept()
    with pytest.raises(KeyboardInterrupt):
        _threads.run_on_threads(kept, "scene", ["a", "b"], 2, stops)
    assert sorted(kept.files) == ["a", "b"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_one_line_with_the_remaining_time():
    out, now = Terminal(), [100.0]
    bar = Bar(out, lambda: now[0])
    bar(0, 4)
    now[0] += 61.0
    bar(1, 4)
    shown = out.getvalue().split("\r")
    assert (
        "\n" not in out.getvalue() and "1/4" in shown[-1] and "1:01, about 3:03 left" in shown[-1]
    )
    # Later output gets its own line.
    bar.print("done")
    assert out.getvalue().endswith("\r\x1b[Kdone\n")
    assert all(len(re.sub(r"\x1b\[K", "", part)) < 80 for part in shown)


def test_a_log_gets_a_line_per_interval():
    out, now = io.StringIO(), [0.0]
    bar = Bar(out, lambda: now[0])
    for done in range(101):
        bar(done, 100)
        now[0] += LOG_INTERVAL_S / 10
    lines = out.getvalue().splitlines()
    assert (
        len(lines) == 11
        and "\r" not in out.getvalue()
        and "0/100" in lines[0]
        and "100/100" in lines[-1]
    )
    assert "left" in lines[1]
