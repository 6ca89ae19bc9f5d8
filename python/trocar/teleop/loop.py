"""Runs a device: reads it a thousand times a second, sends its motion, and drives its motors.

A bridge to a device is a class with `read` and `write` (see `Device`).
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .coupling import DeviceProperties
from .render import Renderer
from .rotation import IDENTITY, Array, inverse, matrix, multiply
from .session import Arm, Frame, Session
from .wire import TeleopError

#: Rate of commands (Hz).
COMMAND_HZ = 60.0
#: Commands whose pose is remembered.
REMEMBERED = 256


@dataclass
class DeviceState:
    """What a device reports."""

    #: Position of the hand (m), in the device's own axes.
    position: Array
    #: Its rotation (w x y z), for a device that measures it.
    rotation: Array = field(default_factory=lambda: IDENTITY)
    #: Opening of the jaw, 0 to 1; None: the device has no such handle.
    jaw: float | None = None
    #: Whether the clutch is pressed: the instrument follows while it is.
    clutch: bool = False


class Device(Protocol):
    """A haptic device, for `HapticLoop`."""

    #: What the force depends on.
    properties: DeviceProperties

    def read(self) -> DeviceState:
        """The present state. Raises OSError when the device is gone."""

    def write(self, force: Array, torque: Array) -> None:
        """Force (N) and torque (N m) on the hand, in the device's axes, until the next call."""


class HapticLoop:
    """Couples a device to an arm, in a thread of its own.

    `axes`: the rotation (3, 3) from the device's axes to those of `frame`: x right, y down, z away
    for the endoscope, x y z of the cell for the world. `scale`: motion of the tip over that of the
    hand, 0.1 to 1. `gain`: force on the hand over that of tissue; 0 sends motion only.
    """

    def __init__(
        self,
        session: Session,
        arm: str,
        device: Device,
        *,
        axes: Array | None = None,
        frame: Frame = "endoscope",
        scale: float = 1.0,
        gain: float = 1.0,
    ):
        if frame == "tool":
            raise ValueError("a haptic loop needs axes that stand still: endoscope or world")
        self.session, self.device, self.frame, self.scale = session, device, frame, scale
        self.arm: Arm = session.arm(arm)
        session.subscribe(haptic=gain > 0.0)
        session.wait(lambda: "scene" in session.latest, "the scene", 120.0)
        #: From the device's axes to the cell's, and to those of the frame.
        own = np.eye(3) if axes is None else np.asarray(axes, float)
        if own.shape != (3, 3) or not np.allclose(own @ own.T, np.eye(3), atol=1e-6):
            raise ValueError("axes must be a rotation matrix (3, 3)")
        self._to_frame = own
        self._to_cell = (_endoscope(session) if frame == "endoscope" else np.eye(3)) @ own
        self.renderer = Renderer(device.properties, scale=scale, gain=gain or 1.0)
        #: Steps done, and how many began more than a sample late.
        self.steps, self.late = 0, 0
        #: Why it ended by itself: the device or the server is gone.
        self.ended: str | None = None
        self._clutch = 0
        self._start: tuple[Array, Array] | None = None
        self._sent: deque[tuple[int, tuple[Array, Array]]] = deque(maxlen=REMEMBERED)
        self._next_command = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="haptic", daemon=True)

    def __enter__(self) -> HapticLoop:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends it: no force, and the arm holds its place."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        sample = self.device.properties.sample_time
        due = time.perf_counter()
        try:
            while not self._stop.is_set():
                self.tick(time.perf_counter())
                due += sample
                left = due - time.perf_counter()
                if left > 0.0:
                    time.sleep(left)
                elif left < -sample:
                    # It was kept waiting: no burst of samples to catch up.
                    self.late += 1
                    due = time.perf_counter()
        except (OSError, TeleopError) as why:
            self.ended = str(why)
        finally:
            self._let_go()

    def _let_go(self) -> None:
        """No force, and no motion."""
        try:
            self.device.write(np.zeros(3), np.zeros(3))
        except OSError as why:
            self.ended = self.ended or str(why)
        try:
            self.arm.release()
        except TeleopError as why:
            self.ended = self.ended or str(why)

    def tick(self, now: float) -> None:
        """One sample: reads, renders, drives. `now`: a clock (s)."""
        state = self.device.read()
        self.steps += 1
        if state.clutch and self._start is None:
            self._clutch += 1
            self._start = (state.position.copy(), state.rotation.copy())
            self._sent.clear()
            self._next_command = now
            self.renderer.reset()
            self.arm.take_model()
        elif not state.clutch and self._start is not None:
            self._start = None
            self.renderer.update(None)
            self.arm.release()
        start = self._start or (state.position, state.rotation)
        turned = multiply(state.rotation, inverse(start[1]))
        if self._start is not None:
            self._take_model()
        wrench = self.renderer.step(
            self._to_cell @ (state.position - start[0]), _in_axes(turned, self._to_cell)
        )
        if self._start is not None and now >= self._next_command:
            self._next_command = max(self._next_command + 1.0 / COMMAND_HZ, now)
            self._command(state.jaw)
        back = self._to_cell.T
        self.device.write(back @ wrench[:3], back @ wrench[3:])

    def _take_model(self) -> None:
        model = self.arm.take_model()
        # Models of before the clutch was pressed say nothing about this hand.
        if model is None or model.seq is None:
            return
        commanded = next((proxy for seq, proxy in self._sent if seq == model.seq), None)
        if commanded is not None:
            self.renderer.update(model, commanded)

    def _command(self, jaw: float | None) -> None:
        """Sends where the proxy is, and the jaw with it."""
        proxy = self.renderer.proxy
        to_frame = self._to_frame @ self._to_cell.T
        seq = self.arm.servo_cr(
            to_frame @ proxy[0],
            _in_axes(proxy[1], to_frame),
            clutch=self._clutch,
            frame=self.frame,
            scale=self.scale,
            jaw=jaw,
        )
        self._sent.append((seq, proxy))


def _in_axes(rotation: Array, axes: Array) -> Array:
    """A rotation in other axes."""
    return np.concatenate([rotation[:1], axes @ rotation[1:]])


def _endoscope(session: Session) -> Array:
    """The rotation from the endoscope's axes to the cell's."""
    cameras = session.latest["scene"].head["cameras"]
    chosen = next((c for c in cameras if c.get("endoscope")), cameras[0] if cameras else None)
    if chosen is None:
        raise ValueError("the scene has no camera; use frame='world'")
    return matrix(np.array(chosen["pose"][3:]))
