"""A session with `trocar view` in the words of the Collaborative Robotics Toolkit (CRTK).

    with trocar.teleop.connect("http://127.0.0.1:8787/?token=...") as session:
        left = session.arm("left")
        left.servo_cp(pose)

A command lives 125 ms of wall time, then the arm holds its place: send at 30 Hz or more while the
arm is to move. Sending never waits; of commands that are not sent yet the latest wins.
"""

from __future__ import annotations

import itertools
import json
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .render import LocalModel
from .rotation import Array
from .wire import TIMEOUT_S, VERSION, Message, TeleopError, Wire

Frame = Literal["endoscope", "tool", "world"]


def _numbers(values: ArrayLike, count: int) -> list[float]:
    """`count` finite numbers. ValueError for anything else."""
    array = np.asarray(values, float)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise ValueError(f"{values!r} must be {count} finite numbers")
    result: list[float] = array.tolist()
    return result


class Arm:
    """One arm, whose seat this session has.

    Poses are x y z (m) qw qx qy qz in the cell. Jaws are 0 (closed) to 1 (open).
    """

    def __init__(self, session: Session, name: str):
        self.name, self._session = name, session
        self._seq = itertools.count(1)
        self._measured: dict[str, Any] | None = None
        self._model: LocalModel | None = None

    # What the arm is asked for.

    def servo_cp(self, pose: ArrayLike, jaw: float | None = None) -> int:
        """Sends the tip to a pose (7,). Returns the command's number."""
        return self._servo("servo_cp", jaw, pose=_numbers(pose, 7))

    def servo_cr(
        self,
        translation: ArrayLike,
        rotation: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        *,
        clutch: int,
        frame: Frame = "endoscope",
        scale: float = 1.0,
        jaw: float | None = None,
    ) -> int:
        """Moves the tip relative to where the clutch was pressed.

        `translation` (m) and `rotation` (w x y z) are the whole motion of the device since then, in
        the axes of `frame`. `clutch` grows at each press. `scale`, 0.1 to 1, is the tip's
        translation over the device's.
        """
        return self._servo(
            "servo_cr",
            jaw,
            clutch=clutch,
            frame=frame,
            scale=scale,
            translation_m=_numbers(translation, 3),
            rotation_wxyz=_numbers(rotation, 4),
        )

    def servo_jp(self, positions: ArrayLike) -> int:
        """Sets the arm's numbers: two pivot angles, insertion, roll, and the jaw if there are 5."""
        count = 5 if np.size(np.asarray(positions)) == 5 else 4
        return self._servo("servo_jp", None, positions=_numbers(positions, count))

    def servo_jaw(self, opening: float) -> int:
        """Opens or closes the jaw, 0 to 1. The tip holds its place."""
        return self._servo("servo_jaw", None, opening=float(opening))

    def release(self) -> None:
        """The clutch is released: the arm holds its place now."""
        self._session.post(self.name, {"type": "release", "arm": self.name})

    def hand_back(self) -> None:
        """The policy has the arm again."""
        self._session.cancel(self.name)
        self._session.request("hand_back", arm=self.name)

    def _servo(self, kind: str, jaw: float | None, **fields: Any) -> int:
        seq = next(self._seq)
        message = {"type": kind, "arm": self.name, "seq": seq, "time_s": time.perf_counter()}
        message |= fields
        if jaw is not None:
            message["jaw"] = float(jaw)
        self._session.post(self.name, message)
        return seq

    # What is measured. The session subscribes to it with the first arm.

    def measured(self) -> dict[str, Any]:
        """All of the newest measurement, in the wire's names. Waits for the first one."""
        self._session.wait(lambda: self._measured is not None, f"a measurement of {self.name}")
        assert self._measured is not None
        return self._measured

    def measured_cp(self) -> Array:
        """Pose of the tip."""
        return np.array(self.measured()["measured_cp"])

    def setpoint_cp(self) -> Array:
        """Pose that the tip is sent to."""
        return np.array(self.measured()["setpoint_cp"])

    def measured_js(self) -> Array:
        """Two pivot angles (rad), insertion (m) and roll (rad)."""
        return np.array(self.measured()["measured_js"])

    def setpoint_js(self) -> Array:
        """The same, as commanded."""
        return np.array(self.measured()["setpoint_js"])

    def jaw_measured_js(self) -> float:
        """Opening of the jaw."""
        return float(self.measured()["jaw_measured_js"])

    def jaw_setpoint_js(self) -> float:
        """Commanded opening of the jaw."""
        return float(self.measured()["jaw_setpoint_js"])

    def measured_cf(self) -> Array:
        """Force (N) and torque (N m) of tissue on the instrument about the tip, cell's axes."""
        return np.array(self.measured()["measured_cf"])

    def actor(self) -> str:
        """Who moves it: policy, operator, hold, replay."""
        return str(self.measured()["actor"])

    def take_model(self) -> LocalModel | None:
        """The newest local model of the tissue, once. Needs `Session.subscribe(haptic=True)`."""
        model, self._model = self._model, None
        return model

    def _take(self, head: dict[str, Any]) -> None:
        """A message `haptic`."""
        pose, setpoint = np.array(head["pose"]), head.get("setpoint")
        if setpoint is None and self._measured is not None:
            setpoint = self._measured["setpoint_cp"]
        goal = None if setpoint is None else np.array(setpoint)
        self._model = LocalModel(
            pose[:3],
            pose[3:],
            np.array(head["force"]),
            np.array(head["stiffness"]).reshape(6, 6),
            head.get("seq"),
            None if goal is None else (goal[:3], goal[3:]),
        )


class Session:
    """A connection to a running `trocar view`. Close it, or use it in `with`."""

    def __init__(self, address: str, *, controls: bool = True, process: Any = None):
        self._process = process
        self._wire = Wire(address)
        self._news = threading.Condition()
        self._requests = itertools.count(1)
        self._replies: dict[int, Message] = {}
        self._mail: dict[str, dict[str, Any]] = {}
        self._urgent: list[dict[str, Any]] = []
        self._arms: dict[str, Arm] = {}
        self._wants: dict[str, Any] = {"frames_hz": 0}
        #: The newest message of each type, such as `status`, `scene`, `organs`, `frame`.
        self.latest: dict[str, Message] = {}
        #: Events of the simulation, oldest first, at most the last 1000.
        self.events: list[dict[str, Any]] = []
        #: Refusals of commands, which have no reply, newest last; and why the connection ended.
        self.refusals: list[str] = []
        self.ended: str | None = None
        threads = (self._receive, self._send)
        self._threads = [threading.Thread(target=one, daemon=True) for one in threads]
        for thread in self._threads:
            thread.start()
        self.wait(lambda: "hello" in self.latest, "the server's hello")
        version = self.latest["hello"].head.get("version")
        if version != VERSION:
            self.close()
            raise TeleopError("version", f"the server speaks version {version} of the wire, not 1")
        self.subscribe()
        if controls:
            self.take("controls")

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the session. The arms that it has hold their place; a launched program ends."""
        self.ended = self.ended or "the session was closed here"
        self._wire.close()
        with self._news:
            self._news.notify_all()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(TIMEOUT_S)
        if self._process is not None:
            _end_process(self._process)
            self._process = None

    # Seats and controls.

    def take(self, *seats: str) -> None:
        """Takes seats: controls, left, right. TeleopError where someone else has one."""
        self.request("seats", take=list(seats), give=[])

    def give(self, *seats: str) -> None:
        """Gives seats back."""
        self.request("seats", take=[], give=list(seats))

    def arm(self, name: str) -> Arm:
        """An arm, left or right, with its seat."""
        if name not in self._arms:
            self.take(name)
            self._arms[name] = Arm(self, name)
            if not self._wants.get("measured_hz"):
                self.subscribe(measured_hz=60)
        return self._arms[name]

    def subscribe(self, **wants: Any) -> None:
        """Changes what the server sends: frames_hz, contacts, held, measured_hz, haptic."""
        self._wants |= wants
        self.request("subscribe", **self._wants)

    def play(self) -> None:
        """Goes on."""
        self.request("play")

    def pause(self) -> None:
        """Stands still."""
        self.request("pause")

    def step(self, periods: int = 1) -> None:
        """Pauses, and computes control periods."""
        self.request("step", periods=periods)

    def speed(self, factor: float) -> None:
        """Simulated over wall time: 0.125 to 8, or 0 for as fast as it goes."""
        self.request("speed", factor=factor)

    def reset(self, seed: int | None = None, policy: str | None = None) -> None:
        """Begins anew, with the same seed and policy unless others are named."""
        fields: dict[str, Any] = {"seed": seed, "policy": policy}
        self.request("reset", **{key: one for key, one in fields.items() if one is not None})

    def record(self, action: Literal["keep", "discard", "redo"]) -> dict[str, Any]:
        """Keeps the episode so far and begins the next seed, or discards it, or begins it again.

        Returns the reply; of `keep` it has `path` and `passed`.
        """
        return self.request("record", action=action).head

    @property
    def status(self) -> dict[str, Any]:
        """The newest status. Waits for the first one."""
        self.wait(lambda: "status" in self.latest, "a status")
        return self.latest["status"].head

    def ready(self, timeout_s: float = 120.0) -> None:
        """Waits until the scene is built. TeleopError with the reason where it cannot be."""
        self.wait(lambda: self.status.get("phase") != "building", "the scene", timeout_s)
        if self.status["phase"] == "failed":
            raise TeleopError("failed", str(self.status.get("message")))

    def history(self, *channels: str, from_s: float = 0.0) -> dict[str, Array]:
        """Channels of the episode so far, one number a control period, and their `time` (s)."""
        reply = self.request("history", channels=list(channels), from_s=from_s)
        rows = np.asarray(reply.arrays["rows"], float).reshape(-1, len(reply.head["channels"]))
        columns = dict(zip(reply.head["channels"], rows.T))
        return columns | {"time": np.asarray(reply.arrays["time"], float)}

    # Messages.

    def request(self, kind: str, timeout_s: float = TIMEOUT_S, **fields: Any) -> Message:
        """Sends a message and waits for its reply. TeleopError where it is refused."""
        number = next(self._requests)
        with self._news:
            self._urgent.append({"type": kind, "request": number, **fields})
            self._news.notify_all()
        self.wait(lambda: number in self._replies, f"the reply to {kind}", timeout_s)
        reply = self._replies.pop(number)
        if reply.head["type"] == "error":
            raise TeleopError(str(reply.head.get("code")), str(reply.head.get("message")))
        return reply

    def post(self, slot: str, message: dict[str, Any]) -> None:
        """Sends soon, instead of what waits in this slot. TeleopError if the connection is gone."""
        if self.ended is not None:
            raise TeleopError("closed", self.ended)
        with self._news:
            self._mail[slot] = message
            self._news.notify_all()

    def cancel(self, slot: str) -> None:
        """Takes back what waits in this slot."""
        with self._news:
            self._mail.pop(slot, None)

    def wait(self, done: Callable[[], bool], what: str, timeout_s: float = TIMEOUT_S) -> None:
        """Waits until `done`, looked at after each message. TeleopError after `timeout_s`."""
        end = time.monotonic() + timeout_s
        with self._news:
            while not done():
                if self.ended is not None:
                    raise TeleopError("closed", self.ended)
                left = end - time.monotonic()
                if left <= 0.0:
                    raise TeleopError("time", f"{what} did not come within {timeout_s:g} s")
                self._news.wait(left)

    def _send(self) -> None:
        try:
            while True:
                with self._news:
                    while not (self._urgent or self._mail or self.ended):
                        self._news.wait()
                    messages = self._urgent + list(self._mail.values())
                    self._urgent, self._mail = [], {}
                for message in messages:
                    self._wire.send(**message)
                if self.ended is not None:
                    return
        except TeleopError as why:
            self._end(str(why))

    def _receive(self) -> None:
        try:
            while True:
                self._sort(self._wire.receive())
        except (TeleopError, ValueError, KeyError, TypeError) as why:
            self._end(str(why) or type(why).__name__)
            self._wire.close()

    def _sort(self, message: Message) -> None:
        head = message.head
        kind, request = head["type"], head.get("request")
        with self._news:
            self.latest[kind] = message
            if request is not None:
                self._replies[int(request)] = message
            elif kind == "error":
                self.refusals = [*self.refusals[-99:], str(head.get("message"))]
            if kind == "event":
                self.events = [*self.events[-999:], head]
            elif kind == "measured":
                for name, arm in self._arms.items():
                    arm._measured = head["arms"].get(name, arm._measured)
            elif kind == "haptic" and head["arm"] in self._arms:
                self._arms[head["arm"]]._take(head)
            self._news.notify_all()

    def _end(self, why: str) -> None:
        with self._news:
            self.ended = self.ended or why
            self._news.notify_all()


def _end_process(process: Any) -> None:
    """Ends a launched program and closes its pipes."""
    process.terminate()
    process.wait()
    process.stdout.close()
    process.stdin.close()


def connect(address: str, *, controls: bool = True) -> Session:
    """Connects to a running `trocar view`, at the address that it prints.

    `controls`: take those of the simulation too (play, reset, record). ConnectionError where no
    server answers, TeleopError where it refuses.
    """
    return Session(address, controls=controls)


def launch(source: str, *options: str, program: str = "trocar") -> Session:
    """Starts `trocar view SOURCE OPTIONS` without a page, and connects. Closing ends it.

    It also ends with this process, even if that is killed: it reads the other end of a pipe.
    """
    view: Sequence[str] = (program, "view", source, "--no-open", "--json", "--port", "0")
    words = (*view, "--until-eof", *options)
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()
    try:
        return Session(json.loads(line)["wire"], process=process)
    except BaseException as why:
        _end_process(process)
        if not line:
            raise OSError(f"{' '.join(words)} ended with status {process.returncode}") from why
        raise
