"""Policies: built-in ones called from Python, and Python's called by the program."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import trocar

msgpack = pytest.importorskip("msgpack")
websockets = pytest.importorskip("websockets")

from trocar import serve

STILL = """
import os
import time
import numpy as np

class Still:
    resets = 0
    def infer(self, obs):
        assert obs["observation/images/endoscope"].dtype == np.uint8, obs.keys()
        state = obs["observation/state"]
        print("a policy may print")
        return {"actions": np.tile(np.r_[state[:5], state[23:28]], (8, 1))}

def raises(obs):
    if obs["episode/step"] > 0:
        raise RuntimeError("no idea what to do")
    state = obs["observation/state"]
    return np.r_[state[:5], state[23:28]]

def reads(obs):
    raise RuntimeError("asked to " + obs["prompt"])

def sleeps(obs):
    with open("served.partial", "w") as file:
        file.write(str(os.getpid()))
    os.rename("served.partial", "served")
    time.sleep(600)
"""


def test_the_scripted_controller_acts_on_an_environment(one):
    expert = trocar.Policy("scripted")
    hashes = []
    for _ in range(2):
        one.reset(seed=3)
        expert.reset(one)
        for _ in range(10):
            one.step(expert(one))
        hashes.append(one.unwrapped.state_hash)
    assert hashes[0] == hashes[1]
    assert "scripted" in trocar.policies() and "random" in trocar.policies()
    with pytest.raises(ValueError, match="scripted"):
        trocar.Policy("genius")


def test_messages_survive_a_round_trip_and_nothing_is_unpickled():
    sent = {
        "a": np.arange(6, dtype="<f4").reshape(2, 3),
        "n": np.int64(3),
        "b": [True, None, "text", b"bytes"],
    }
    got = serve.unpack(serve.pack(sent))
    assert (
        np.array_equal(got["a"], sent["a"])
        and got["a"].dtype == np.float32
        and got["n"] == 3
        and got["b"] == sent["b"]
    )
    bad = [
        {b"__ndarray__": True, b"data": b"x", b"dtype": "|O", b"shape": [1]},
        {b"__ndarray__": True, b"data": b"x", b"dtype": "<f8", b"shape": [1]},
        {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "<f8", b"shape": [-1]},
        {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "nonsense", b"shape": [1]},
    ]
    for message in [*map(msgpack.packb, bad), b"\xc1", b""]:
        with pytest.raises(ValueError):
            serve.unpack(message)


def test_a_server_answers_resets_and_sends_errors():
    from websockets.sync.client import connect

    class Policy:
        resets = 0

        def infer(self, obs):
            if "bad" in obs:
                raise KeyError("bad")
            return {"actions": np.full(10, obs["x"])}

        def reset(self):
            self.resets += 1

    address, ready, policy = [], threading.Event(), Policy()

    def on_listening(url):
        address.append(url)
        ready.set()

    threading.Thread(
        target=serve.serve,
        args=(serve.Served(policy),),
        kwargs={"on_listening": on_listening},
        daemon=True,
    ).start()
    assert ready.wait(10) and address[0].startswith("ws://127.0.0.1:")
    with connect(address[0]) as client:
        assert serve.unpack(client.recv())["server"] == "trocar.serve"
        client.send(serve.pack({"x": 2.0, "episode/step": 0}))
        reply = serve.unpack(client.recv())
        assert (
            reply["actions"].shape == (1, 10)
            and reply["server_timing"]["infer_ms"] >= 0
            and policy.resets == 1
        )
        client.send(serve.pack({"endpoint": "reset"}))
        assert client.recv() == "reset successful" and policy.resets == 2
        client.send(serve.pack({"bad": 1}))
        assert client.recv().strip().splitlines()[-1] == "KeyError: 'bad'"


def steps(file):
    """Actions and state hashes of an episode file (docs/guides/tasks.md)."""
    _, _, body = file.read_bytes().partition(b"\n")
    kind = np.dtype([("space", "u1"), ("action", "<f8", 10), ("hash", "<u8")])
    return np.frombuffer(body[:-8], kind)


def test_the_scripted_controller_is_the_programs_bit_for_bit(program, lift_scene, tmp_path):
    phantoms = trocar.envs.cells.phantoms_folder()
    recorded = []
    for command in (["episode"], ["evaluate", "--episodes", "1"]):
        out = tmp_path / command[0]
        words = [*command, lift_scene, "--policy", "scripted", "--seed", 11, "-o", out]
        called = [program, "--quiet", *words, "--variation", "none", "--phantoms", phantoms]
        subprocess.run(list(map(str, called)), check=True, capture_output=True)
        recorded.append(steps(next(out.rglob("episode.trocar"))))
    assert np.array_equal(recorded[0], recorded[1])
    env = trocar.TrocarEnv(scene=str(lift_scene), threads=2, variation="none")
    expert = trocar.Policy("scripted")
    env.reset(seed=11)
    expert.reset(env)
    for k, step in enumerate(recorded[0]):
        action = expert(env)
        assert np.array_equal(action, step["action"]), f"action {k}"
        *_, ended, late, info = env.step(action)
        assert env.state_hash == step["hash"], f"state {k}"
        assert (ended or late) == (k == len(recorded[0]) - 1)
    assert info["is_success"] and len(recorded[0]) > 100


def command_of(program, scene, tmp_path, policies):
    """The arguments of a process that evaluates Python policies."""
    (tmp_path / "mine.py").write_text(STILL)
    named = [word for policy in policies for word in ("--policy", policy)]
    command = [
        program,
        "--quiet",
        "--json",
        "evaluate",
        scene,
        *named,
        "--episodes",
        "2",
        "--variation",
        "none",
        "-o",
        tmp_path / "out",
    ]
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    phantoms = trocar.envs.cells.phantoms_folder()
    environment = os.environ | {"TROCAR_PYTHON": sys.executable, "PYTHONPATH": paths}
    return {
        "args": [*map(str, command), "--phantoms", str(phantoms)],
        "env": environment,
        "cwd": tmp_path,
    }


def evaluated(program, scene, tmp_path, policies):
    done = subprocess.run(
        **command_of(program, scene, tmp_path, policies), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def runs(process):
    """Whether a process runs. A zombie does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_a_served_policy_ends_when_the_program_is_killed(program, short_scene, tmp_path):
    served = tmp_path / "served"
    command = command_of(program, short_scene, tmp_path, ["sleeps=python:mine:sleeps"])
    started = subprocess.Popen(**command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until(served.exists, 60)
        assert runs(served.read_text())
    finally:
        started.kill()
        started.wait()
    until(lambda: not runs(served.read_text()), 10)


@pytest.mark.skipif(sys.platform != "linux", reason="a shell closes the input")
def test_a_server_whose_input_is_closed_ends(tmp_path):
    (tmp_path / "mine.py").write_text("def still(obs):\n    return [0.0] * 10\n")
    served = [sys.executable, "-m", "trocar.serve", "mine:still", "--port", "0", "--until-eof"]
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" <&-', "sh", *served],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0 and "Exception" not in done.stderr, done.stderr


def until(true, seconds):
    """Waits until `true()`."""
    begun = time.monotonic()
    while not true():
        assert time.monotonic() - begun < seconds, f"not true within {seconds} s"
        time.sleep(0.05)


def test_the_program_evaluates_a_python_policy_and_survives_one_that_raises(
    program, short_scene, tmp_path
):
    result = evaluated(
        program,
        short_scene,
        tmp_path,
        ["still=python:mine:Still", "raises=python:mine:raises", "reads=python:mine:reads"],
    )
    still, raises, reads = result["policies"]
    assert (still["episodes"], still["ends"]["policy-error"]) == (2, 0), still
    assert (raises["episodes"], raises["ends"]["policy-error"]) == (2, 2), raises
    for episode in range(2):
        kept = json.loads((tmp_path / f"out/episodes/raises/{episode:06}/result.json").read_text())
        # No address, whose port is random.
        why = kept["end"]["why"]
        assert why.startswith("python:mine:raises: RuntimeError: no idea what to do"), why
    assert reads["ends"]["policy-error"] == 2
    kept = json.loads((tmp_path / "out/episodes/reads/000000/result.json").read_text())
    asked = trocar.TrocarEnv(scene=str(short_scene), variation="none").task_description
    assert f"asked to {asked}" in kept["end"]["why"], (
        "a served policy and an environment get the same prompt"
    )


@pytest.mark.parametrize("beside", [[], ["slow=python:mortal.py:slow"]])
def test_a_policy_whose_process_ends_after_an_episode_is_served_again(
    program, short_scene, tmp_path, beside
):
    """Its process ends before or during the next episode's first request.

    During an episode of another policy the closed connection is noticed earlier.
    """
    (tmp_path / "mortal.py").write_text(
        "import os, threading, time\nimport numpy as np\n"
        "def still(obs):\n    s = obs['observation/state']\n"
        "    return {'actions': np.tile([*s[:5], *s[23:28]], (8, 1))}\n"
        "last = []\n"
        "def act(obs):\n    if last and obs['episode/step'] == 0:\n        os._exit(3)\n"
        "    if obs['episode/step'] >= 8:\n        last.append(True)\n"
        "        threading.Timer(0.05, os._exit, [3]).start()\n    return still(obs)\n"
        "def slow(obs):\n    time.sleep(1.0)\n    return still(obs)\n"
    )
    command = command_of(program, short_scene, tmp_path, ["mortal=python:mortal.py:act", *beside])
    done = subprocess.run(
        **command | {"args": [*command["args"], "--jobs", "1"]}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert [row["ends"]["policy-error"] for row in json.loads(done.stdout)["policies"]] == [0] * (
        1 + len(beside)
    ), done.stdout


def served(*words, **options):
    """The finished process of `python -m trocar.serve`."""
    command = [sys.executable, "-m", "trocar.serve", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, **options)


@pytest.mark.parametrize(
    "policy, said",
    [
        ("nothing.here:Policy", "there is no module nothing.here"),
        ("nothing.py:Policy", "there is no file"),
        ("os:nothing", "there is no nothing in os"),
        ("os", "'os' must be FILE.py:NAME or MODULE:NAME"),
        ("os:sep", "a str is not a policy"),
    ],
)
def test_a_policy_that_does_not_exist_is_one_line(policy, said):
    done = served(policy, "--port", "0")
    (line,) = done.stderr.strip().splitlines()
    assert done.returncode == 1 and not done.stdout
    assert line.startswith("error: ") and said in line


def test_an_error_of_the_policys_code_is_shown_once_with_its_place(tmp_path):
    (tmp_path / "broken.py").write_text("import no_such_package\n")
    done = served("broken.py:Policy", cwd=tmp_path)
    *place, line = done.stderr.strip().splitlines()
    assert done.returncode == 1 and line == (
        "error: ModuleNotFoundError: No module named 'no_such_package'"
    )
    assert done.stderr.count("No module named") == 1 and "Traceback" not in done.stderr
    assert "broken.py" in place[0] and "trocar/serve.py" not in done.stderr


def without(package, folder):
    """The environment of a process in which `package` cannot be imported."""
    missing = f"raise ModuleNotFoundError(\"No module named '{package}'\", name='{package}')\n"
    (folder / f"{package}.py").write_text(missing)
    paths = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    return os.environ | {"PYTHONPATH": paths}


EXTRA = "needs the extra 'policies' (No module named 'msgpack'); run pip install '.[policies]'"


def test_a_missing_extra_is_one_line_with_the_remedy(tmp_path):
    done = served("mine.py:act", env=without("msgpack", tmp_path))
    assert done.returncode == 1
    assert done.stderr.strip() == f"error: trocar.serve {EXTRA}"


@pytest.mark.parametrize("port", ["99999", "-1", "http"])
def test_a_bad_port_is_refused(port):
    done = served("os:fspath", f"--port={port}")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    line = done.stderr.strip().splitlines()[-1]
    assert line.endswith(f"argument --port: '{port}' must be an integer in [0, 65535]")


def test_an_address_that_cannot_be_used_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = served("os:fspath", "--port", str(port))
    (line,) = done.stderr.strip().splitlines()
    assert done.returncode == 1 and f"cannot listen at 127.0.0.1:{port}" in line


def test_a_file_is_a_policy_by_its_path(tmp_path, monkeypatch):
    """It imports modules beside it and may have the name of an imported module."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in ("json", "by_path"):
        (tmp_path / f"{name}.py").write_text(
            "import beside\nclass Acts:\n    class Inner:\n"
            "        def infer(self, obs):\n            return beside.ACTION\n"
        )
    (tmp_path / "beside.py").write_text("ACTION = [1.0, 2.0]\n")
    for source in (
        f"{tmp_path}/json.py:Acts.Inner",
        f"{tmp_path}/by_path.py:Acts.Inner",
        "by_path:Acts.Inner",
    ):
        assert serve.load(source).infer({})["actions"].tolist() == [[1.0, 2.0]], source
    monkeypatch.chdir(tmp_path)
    assert serve.load("by_path.py:Acts.Inner").infer({})["actions"].shape == (1, 2)
    assert sys.modules["json"] is json


@pytest.mark.parametrize(
    "policy, said",
    [
        ("python:mine.py:nothing", "no nothing in mine.py"),
        ("python:other.py:Still", "loaded: there is no file "),
    ],
)
def test_the_program_stops_at_a_policy_that_cannot_be_loaded(
    program, short_scene, tmp_path, policy, said
):
    command = command_of(program, short_scene, tmp_path, ["random", policy])
    command["args"][-1] = str(tmp_path / "phantoms")
    done = subprocess.run(**command, capture_output=True, text=True, timeout=120)
    (line,) = done.stderr.strip().splitlines()
    assert done.returncode == 2
    assert line.startswith(f"error: {policy}: cannot be loaded: ") and said in line
    # Neither a campaign nor a phantom was started.
    assert os.listdir(tmp_path) == ["mine.py"]


def test_the_program_names_a_missing_extra(program, short_scene, tmp_path):
    command = command_of(program, short_scene, tmp_path, ["python:mine.py:Still"])
    command["args"][-1] = str(tmp_path / "phantoms")
    (tmp_path / "hidden").mkdir()
    command["env"] = without("msgpack", tmp_path / "hidden")
    command["env"]["TROCAR_PYTHON"] = sys.executable
    done = subprocess.run(**command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and sorted(os.listdir(tmp_path)) == ["hidden", "mine.py"]
    assert done.stderr.strip() == (
        f"error: python:mine.py:Still: cannot be loaded: trocar.serve {EXTRA}"
    )


def test_the_program_serves_a_file(program, short_scene, tmp_path):
    (still,) = evaluated(
        program, short_scene, tmp_path, [f"still=python:{tmp_path}/mine.py:Still"]
    )["policies"]
    assert (still["episodes"], still["ends"]["policy-error"]) == (2, 0), still
