"""The client of `trocar view`: against a server of the test, and against the program."""

import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from trocar import teleop
from trocar.teleop.simulated import DEVICE, HeldDevice
from trocar.teleop.wire import parse, wire_address

POSE = [0.01, 0.02, 0.03, 1.0, 0.0, 0.0, 0.0]
CAMERA = {"name": "endoscope", "endoscope": True, "pose": [0, 0, 0, 0.5, -0.5, 0.5, -0.5]}


class Server:
    """Says hello, answers requests, and keeps what it is sent."""

    def __init__(self):
        self.got, self.refuse, self.connections = [], set(), []
        self.server = serve(self.handle, "127.0.0.1", 0)
        port = self.server.socket.getsockname()[1]
        self.address = f"http://127.0.0.1:{port}/?token=abc"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def handle(self, connection):
        self.path = connection.request.path
        self.connections.append(connection)
        self.say(type="hello", version=1, client=7)
        self.say(type="status", phase="ready", playing=True)
        self.say(type="scene", cameras=[CAMERA])
        try:
            for text in connection:
                message = json.loads(text)
                self.got.append(message)
                if "request" in message:
                    kind = "error" if message["type"] in self.refuse else "done"
                    told = {"code": "seat", "message": "client 3 has it"} if kind == "error" else {}
                    self.say(type=kind, request=message["request"], **told)
        except ConnectionClosed:
            pass

    def say(self, **message):
        self.connections[-1].send(json.dumps(message))

    def of(self, *kinds):
        return [m for m in self.got if m["type"] in kinds]

    def wait(self, done):
        end = time.monotonic() + 10.0
        while not done():
            assert time.monotonic() < end, self.got
            time.sleep(0.005)


@pytest.fixture
def server():
    one = Server()
    yield one
    one.server.shutdown()


def measured(**changes):
    arm = {
        "measured_cp": POSE, "setpoint_cp": POSE, "measured_js": [1, 2, 3, 4],
        "setpoint_js": [1, 2, 3, 4], "jaw_measured_js": 0.25, "jaw_setpoint_js": 0.5,
        "measured_cf": [0, 0, 1, 0, 0, 0], "actor": "operator",
    }  # fmt: skip
    return {"type": "measured", "arms": {"left": arm | changes}}


def test_commands_and_measurements_have_the_words_of_crtk(server):
    with teleop.connect(server.address) as session:
        assert server.path == "/wire/1?token=abc"
        left = session.arm("left")
        assert [m["take"] for m in server.of("seats")] == [["controls"], ["left"]]
        assert server.of("subscribe")[-1]["measured_hz"] == 60
        for send in (
            lambda: left.servo_cp(POSE, jaw=0.5),
            lambda: left.servo_cr([0.001, 0, 0], clutch=1, scale=0.5),
            lambda: left.servo_jp([0.1, 0.2, 0.1, 0.0]),
            lambda: left.servo_jaw(0.75),
        ):
            count = len(server.got)
            send()
            server.wait(lambda n=count: len(server.got) > n)
        kinds = ("servo_cp", "servo_cr", "servo_jp", "servo_jaw")
        sent = server.of(*kinds)
        assert [m["type"] for m in sent] == list(kinds)
        assert [m["seq"] for m in sent] == [1, 2, 3, 4]
        assert sent[0]["pose"] == POSE and sent[0]["jaw"] == 0.5
        assert sent[1]["frame"] == "endoscope" and sent[1]["scale"] == 0.5 and "jaw" not in sent[1]
        assert sent[3]["opening"] == 0.75
        left.release()
        server.wait(lambda: server.of("release"))
        left.hand_back()
        assert server.of("hand_back")
        server.say(**measured())
        assert np.allclose(left.measured_cp(), POSE) and left.measured_cf()[2] == 1.0
        assert left.jaw_measured_js() == 0.25 and left.actor() == "operator"
        for wrong in ([0.0] * 6, [np.nan] * 7):
            with pytest.raises(ValueError, match="7 finite numbers"):
                left.servo_cp(wrong)


def test_refusals_are_errors(server):
    server.refuse = {"record", "play"}
    with teleop.connect(server.address) as session:
        with pytest.raises(teleop.TeleopError, match="client 3 has it") as caught:
            session.record("keep")
        assert caught.value.code == "seat"
        server.say(type="error", request=None, code="value", message="wrong")
        session.wait(lambda: session.refusals == ["wrong"], "the refusal")


def test_of_waiting_commands_the_latest_wins(server):
    with teleop.connect(server.address) as session:
        left = session.arm("left")
        with session._news:
            for k in range(100):
                left.servo_jaw(k / 100)
        server.wait(lambda: server.of("servo_jaw"))
        assert [m["opening"] for m in server.of("servo_jaw")] == [0.99]


def test_a_server_that_goes_is_said(server):
    session = teleop.connect(server.address)
    left = session.arm("left")
    device = HeldDevice(DEVICE)
    with teleop.HapticLoop(session, "left", device) as loop:
        device.clutch = True
        server.wait(lambda: server.of("servo_cr"))
        server.connections[-1].close()
        server.wait(lambda: loop.ended)
    assert not device.wrench.any()
    with pytest.raises(teleop.TeleopError, match=r"gone|closed"):
        left.servo_cp(POSE)
    session.close()


def test_a_device_that_goes_lets_the_arm_hold(server):
    class Broken(HeldDevice):
        def read(self):
            if self.peak < 0.0:
                raise OSError("unplugged")
            return super().read()

    with teleop.connect(server.address) as session:
        device = Broken(DEVICE)
        device.clutch = True
        with teleop.HapticLoop(session, "left", device) as loop:
            server.wait(lambda: server.of("servo_cr"))
            device.peak = -1.0
            server.wait(lambda: loop.ended == "unplugged")
            server.wait(lambda: server.of("release"))


def test_motion_is_relative_to_where_the_clutch_was_pressed(server):
    """In the axes of the device's own mount, too."""
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with teleop.connect(server.address) as session:
        device = HeldDevice(DEVICE)
        device.simulated.place[:3] = [0.5, 0.0, 0.0]
        loop = teleop.HapticLoop(session, "left", device, axes=turned, scale=0.5)
        now = 0.0
        for clutch, x in ((True, 0.5), (True, 0.52), (False, 0.6), (True, 0.6), (True, 0.61)):
            device.clutch, device.simulated.place[0] = clutch, x
            device.wish = device.simulated.place.copy()
            count = len(server.got)
            loop.tick(now)
            now += 0.05
            server.wait(lambda n=count: len(server.got) > n)
        sent = [m for m in server.got if m["type"] in ("servo_cr", "release")]
        assert [m["type"] for m in sent] == [
            "servo_cr",
            "servo_cr",
            "release",
            "servo_cr",
            "servo_cr",
        ]
        assert [m.get("clutch") for m in sent] == [1, 1, None, 2, 2]
        moved = [m["translation_m"] for m in sent if "clutch" in m]
        assert np.allclose(moved, [[0, 0, 0], [0, -0.02, 0], [0, 0, 0], [0, -0.01, 0]], atol=1e-6)


def test_a_haptic_model_pushes_the_hand(server):
    """In the endoscope's axes, of which the cell's z is one."""
    with teleop.connect(server.address) as session:
        device = HeldDevice(DEVICE)
        device.clutch = True
        loop = teleop.HapticLoop(session, "left", device)
        loop.tick(0.0)
        seq = 1
        stiffness = np.diag([0.0, 0.0, 500.0, 0.0, 0.0, 0.0]).ravel().tolist()
        server.say(
            type="haptic", arm="left", pose=POSE, setpoint=POSE, force=[0.0] * 6,
            stiffness=stiffness, seq=seq,
        )  # fmt: skip
        session.wait(lambda: loop.arm._model is not None, "the model")
        # The axis of the device along which the cell's z grows.
        up = loop._to_cell.T @ [0.0, 0.0, 1.0]
        for k in range(100):
            device.simulated.place[:3] = -1e-4 * k * up
            device.wish = device.simulated.place.copy()
            loop.tick(1e-3 * k)
        assert device.wrench[:3] @ up > 1.0
        assert np.allclose(device.wrench[:3], (device.wrench[:3] @ up) * up, atol=1e-6)


def test_messages_are_taken_apart():
    head = json.dumps(
        {"type": "frame", "arrays": {"row": {"dtype": "f32", "shape": [2], "offset": 0}}}
    )
    head += " " * (-(4 + len(head)) % 8)
    data = struct.pack("<I", len(head)) + head.encode() + struct.pack("<2f", 1.5, -2.0)
    assert parse(data).arrays["row"].tolist() == [1.5, -2.0]
    for wrong in (b"", b"\xff\xff\xff\xff", data[:-1], "[]", "{}", "garbage"):
        with pytest.raises(ValueError):
            parse(wrong)


def test_addresses():
    assert wire_address("http://localhost:1/?token=t") == "ws://localhost:1/wire/1?token=t"
    for wrong in ("localhost", "http://localhost:1/", "ftp://x/?token=t"):
        with pytest.raises(ValueError, match="address of trocar view"):
            wire_address(wrong)
    with pytest.raises(ConnectionError, match="no connection"):
        teleop.connect("http://127.0.0.1:9/?token=t")


@pytest.fixture
def viewer(program):
    """The program, if it can view. Its test runs in real time, which slow machines do not keep."""
    if "TROCAR_REALTIME" not in os.environ:
        pytest.skip("runs in real time: set TROCAR_REALTIME=1 on an idle machine")
    if subprocess.run([program, "view", "--help"], capture_output=True).returncode:
        pytest.skip(f"{program} has no command view")
    return program


def test_an_operator_feels_an_organ_of_the_program(viewer):
    """A simulated hand presses the left instrument onto the appendix by a simulated device."""
    words = ("--policy", "operator", "--variation", "none", "--threads", "1")
    with teleop.launch("cell-a", *words, program=viewer) as session:
        session.ready()
        device = HeldDevice(DEVICE)
        with teleop.HapticLoop(session, "left", device, frame="world") as loop:
            tip = loop.arm.setpoint_cp()[:3]
            organs = session.latest["organs"]
            (appendix,) = [o for o in organs.head["organs"] if o["name"] == "appendix"]
            places = organs.arrays[appendix["rest"]]
            top = places[places[:, 2] > np.quantile(places[:, 2], 0.9)].mean(0)
            way = top - tip - [0.0, 0.0, 0.006]
            device.clutch = True
            begun = time.monotonic()
            while time.monotonic() < begun + 6.0 and device.peak < 0.3:
                device.wish[:3] = way * min(1.0, (time.monotonic() - begun) / 3.0)
                time.sleep(0.01)
            assert loop.ended is None, loop.ended
            if "haptic" not in session.latest:
                pytest.skip(f"{viewer} sends no haptic models")
            assert loop.arm.actor() == "operator"
            assert np.linalg.norm(loop.arm.measured_cp()[:3] - tip) > 0.02
            assert device.peak > 0.05
            time.sleep(0.5)
            assert device.active < 1e-6
        assert not session.refusals, session.refusals


def test_a_launched_program_ends_with_a_killed_parent(program):
    code = f"""
import time
from trocar import teleop
session = teleop.launch("cell-a", "--paused", program={program!r})
print(session._wire._socket.remote_address[1], flush=True)
time.sleep(60)
"""
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    with parent:
        place = ("127.0.0.1", int(parent.stdout.readline()))
        socket.create_connection(place).close()
        parent.kill()
    end = time.monotonic() + 30.0
    with pytest.raises(OSError):
        while time.monotonic() < end:
            socket.create_connection(place).close()
            time.sleep(0.1)


def blocks():
    """The Python of the guide."""
    guide = (Path(__file__).parents[2] / "docs/guides/teleoperation.md").read_text()
    return [part.partition("```")[0] for part in guide.split("```python\n")[1:]]


def test_the_bridges_of_the_guide_are_short_and_compile():
    for code in blocks():
        compile(code, "guide", "exec")
        assert len(code.splitlines()) <= 50


def test_the_bridge_to_an_inverse3_speaks_with_its_service():
    """With a service that was written after its documentation: no device was there."""
    told = []

    def service(connection):
        state = {"cursor_position": {"x": 0.1, "y": 0.2, "z": 0.3}}
        grip = {
            "orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
            "buttons": {"a": True, "b": False, "c": False},
        }
        connection.send(
            json.dumps(
                {
                    "inverse3": [{"device_id": "0042", "state": state}],
                    "wireless_verse_grip": [{"device_id": "61", "state": grip}],
                }
            )
        )
        told.append(json.loads(connection.recv()))

    (code,) = [one for one in blocks() if "class Inverse3" in one]
    with serve(service, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = server.socket.getsockname()[1]
        place = {}
        exec(code.partition("# The device's")[0].replace("10001", str(port)), place)
        device = place["Inverse3"]()
        state = device.read()
        assert state.position.tolist() == [0.1, 0.2, 0.3] and state.clutch and state.jaw == 1.0
        device.write(np.array([1.0, 2.0, 3.0]), np.zeros(3))
        with pytest.raises(OSError, match="is gone"):
            for _ in range(20):
                device.read()
        server.shutdown()
    (command,) = told
    (arm,) = command["inverse3"]
    assert arm["device_id"] == "0042"
    assert arm["commands"]["set_cursor_force"]["values"] == {"x": 1.0, "y": 2.0, "z": 3.0}
