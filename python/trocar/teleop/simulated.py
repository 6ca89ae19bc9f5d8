"""A haptic device, a hand, tissue and a network that do not exist, for tests and measurements.

Nothing here needs a socket or a clock: `Trial.run` steps all of it, the device at its sample time,
the tissue at 60 Hz, with commands and models that are late, and some lost.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .coupling import Coupling, DeviceProperties
from .loop import DeviceState
from .render import LocalModel, Renderer
from .rotation import IDENTITY, Array, between, from_vector

#: Rates of the simulation behind the wire (Hz).
TISSUE_HZ, CONTROL_HZ = 60, 30
#: Time constant of a simulated arm (s).
ARM_S = 0.03
#: Friction of tissue over its stiffness (s), and mass of what moves with the instrument (kg).
TISSUE_DAMPING_S, TISSUE_MASS = 5e-3, 1e-3
#: Length by which a hold resists rotation (m).
HOLD_LENGTH = 5e-3


@dataclass(frozen=True)
class Hand:
    """A hand that pulls a device to where it wants it: a spring and a damper."""

    #: N/m, N s/m, N m/rad, N m s/rad.
    stiffness: float = 400.0
    damping: float = 4.0
    rotational_stiffness: float = 1.0
    rotational_damping: float = 0.01


class SimulatedDevice:
    """A mass with friction, driven by a hand and by the forces that are written, which come late.

    The steps are exact for forces and a wish of the hand that are constant in between.
    """

    def __init__(self, properties: DeviceProperties, hand: Hand | None = None):
        self.properties, self.hand = properties, hand or Hand()
        #: Position (m) and rotation vector (rad), and their rates.
        self.place, self.rate = np.zeros(6), np.zeros(6)
        #: Energy that the written forces have put into it, less what its own friction certainly
        #: took of them (J): must stay at or below 0, up to rounding, to call them passive.
        self.active = 0.0
        #: The same without the friction (J).
        self.received = 0.0
        self._pending: deque[Array] = deque([np.zeros(6)] * properties.delay_samples)
        self._steps = {held: self._exact(held) for held in (False, True)}

    def _exact(self, held: bool) -> list[tuple[Array, Array]]:
        """Matrices of a step, for translation and rotation: of the state, and of the force."""
        device, hand, result = self.properties, self.hand, []
        for mass, friction, spring, damper in (
            (device.mass, device.damping, hand.stiffness, hand.damping),
            (
                device.inertia or 1.0,
                device.rotational_damping or 1.0,
                hand.rotational_stiffness,
                hand.rotational_damping,
            ),
        ):
            k, b = (spring, damper + friction) if held else (0.0, friction)
            # The exponential of d/dt (place, rate, force) with a constant force, as a series.
            rows = np.array([[0.0, 1.0, 0.0], [-k / mass, -b / mass, 1.0 / mass], [0.0, 0.0, 0.0]])
            whole, term = np.eye(3), np.eye(3)
            for n in range(1, 20):
                term = term @ rows * (device.sample_time / n)
                whole = whole + term
            result.append((whole[:2, :2], whole[:2, 2]))
        return result

    def read(self) -> tuple[Array, Array]:
        """Position (m) and quaternion."""
        return self.place[:3].copy(), from_vector(self.place[3:])

    def advance(self, wrench: Array, wish: Array | None) -> None:
        """A sample time after `wrench` is written. `wish`: where the hand wants it; None: free."""
        self._pending.append(wrench)
        applied = self._pending.popleft()
        before, rotated = self.place.copy(), from_vector(self.place[3:])
        for part, (state, force) in zip(
            (slice(0, 3), slice(3, 6)), self._steps[wish is not None], strict=True
        ):
            # About the wish.
            origin = np.zeros(3) if wish is None else wish[part]
            both = np.array([self.place[part] - origin, self.rate[part]])
            both = state @ both + np.outer(force, applied[part])
            self.place[part], self.rate[part] = both[0] + origin, both[1]
        moved = self.place - before
        moved[3:] = between(rotated, from_vector(self.place[3:]))
        work = float(applied @ moved)
        device = self.properties
        friction = np.array([device.damping] * 3 + [device.rotational_damping] * 3)
        self.received += work
        self.active += work - float(friction @ moved**2) / device.sample_time

    @property
    def moving(self) -> float:
        """Kinetic energy (J)."""
        device = self.properties
        masses = np.array([device.mass] * 3 + [device.inertia] * 3)
        return 0.5 * float(masses @ self.rate**2)


class HeldDevice:
    """A simulated device in a simulated hand, for `HapticLoop`: each write is a sample time.

    Set `wish` (position, rotation vector; (6,)), `jaw` and `clutch` from any thread.
    """

    def __init__(self, properties: DeviceProperties, hand: Hand | None = None):
        self.properties = properties
        self.simulated = SimulatedDevice(properties, hand)
        self.wish = np.zeros(6)
        self.jaw: float | None = None
        self.clutch = False
        #: The newest force and torque, and the greatest force so far (N).
        self.wrench = np.zeros(6)
        self.peak = 0.0
        #: Greatest of `SimulatedDevice.active` so far (J).
        self.active = 0.0

    def read(self) -> DeviceState:
        """The present state."""
        position, rotation = self.simulated.read()
        return DeviceState(position, rotation, self.jaw, self.clutch)

    def write(self, force: Array, torque: Array) -> None:
        """The motors' force, and a sample time of motion."""
        self.wrench = np.concatenate([force, torque])
        self.peak = max(self.peak, float(np.linalg.norm(force)))
        self.simulated.advance(self.wrench, self.wish)
        self.active = max(self.active, self.simulated.active)


class SimulatedTissue:
    """What answers on the other side: an arm that follows, with tissue at its tip.

    `kind`: "press", tissue below z = 0 that pushes; "hold", tissue that the jaws hold at 0, which
    pulls back and resists rotation. A spring with friction and mass, stepped implicitly.
    """

    def __init__(self, stiffness: float, kind: str):
        self.stiffness, self.kind = stiffness, kind
        self.tip, self.target = np.zeros(6), np.zeros(6)
        if kind == "press":
            self.tip[2] = self.target[2] = 0.05
        #: Displacement of tissue, and its rate.
        self.strain, self.rate = np.zeros(6), np.zeros(6)
        self.force = np.zeros(6)

    def command(self, target: Array) -> None:
        """A control period begins."""
        self.target = target

    def advance(self) -> None:
        """A tissue frame."""
        h = 1.0 / TISSUE_HZ
        before = self.strain.copy()
        self.tip = self.tip + (1.0 - math.exp(-h / ARM_S)) * (self.target - self.tip)
        k, b, m = self._numbers()
        # Free tissue.
        free = (m / h**2 * (before + h * self.rate) + b / h * before) / (m / h**2 + b / h + k)
        if self.kind == "hold":
            now, touched = self.tip.copy(), np.ones(6, bool)
        else:
            touched = np.array([False, False, self.tip[2] < free[2], False, False, False])
            now = np.where(touched, self.tip, free)
        rate = (now - before) / h
        self.force = np.where(touched, -(k * now + b * rate + m * (rate - self.rate) / h), 0.0)
        self.strain, self.rate, self.touched = now, rate, touched

    def _numbers(self) -> tuple[Array, Array, Array]:
        """Stiffness, friction and mass."""
        size = np.array([1.0] * 3 + [HOLD_LENGTH**2] * 3)
        k = self.stiffness * size
        return k, TISSUE_DAMPING_S * k, TISSUE_MASS * size

    @property
    def energy(self) -> float:
        """Elastic and kinetic (J)."""
        k, _, m = self._numbers()
        return 0.5 * float(k @ self.strain**2 + m @ self.rate**2)

    def elastic(self, place: Array) -> Array:
        """The force of tissue at rest on a tip that is held there."""
        k = self._numbers()[0]
        if self.kind == "hold":
            return -k * place
        force = np.zeros(6)
        force[2] = -k[2] * min(place[2], 0.0)
        return force

    def model(self, seq: int | None) -> LocalModel:
        """The message `haptic`."""
        h = 1.0 / TISSUE_HZ
        k, b, m = self._numbers()
        stiffness = np.diag(np.where(self.touched, k + b / h + m / h**2, 0.0))
        setpoint = (self.target[:3].copy(), from_vector(self.target[3:]))
        return LocalModel(
            self.tip[:3].copy(),
            from_vector(self.tip[3:]),
            self.force,
            stiffness,
            seq,
            setpoint,
        )


@dataclass
class Link:
    """A connection that delays, and loses."""

    delay_s: float
    lost: float = 0.0
    dice: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    _under_way: deque[tuple[float, object]] = field(default_factory=deque)

    def send(self, time_s: float, message: object) -> None:
        """Sends, or loses, a message."""
        if self.dice.random() >= self.lost:
            self._under_way.append((time_s + self.delay_s, message))

    def receive(self, time_s: float) -> object | None:
        """The newest message that has arrived, once."""
        newest = None
        while self._under_way and self._under_way[0][0] <= time_s + 1e-9:
            newest = self._under_way.popleft()[1]
        return newest


#: A typical desktop device.
DEVICE = DeviceProperties(
    mass=0.1,
    damping=2.0,
    max_force=8.0,
    inertia=1e-4,
    rotational_damping=1e-3,
    max_torque=0.2,
)


@dataclass
class Trial:
    """A hand that meets tissue, works there, and lets go.

    `naive` renders the force of the newest model as it is, as a client without this library would.
    """

    #: N/m.
    stiffness: float
    kind: str = "press"
    link_s: float = 0.01
    lost: float = 0.0
    device: DeviceProperties = DEVICE
    naive: bool = False
    duration_s: float = 3.5
    release_s: float = 2.0
    #: Called with the time (s); where the hand wants the device.
    wish: Callable[[float], Array] | None = None

    def run(self) -> Log:
        """Steps all of it."""
        device = SimulatedDevice(self.device)
        renderer = Renderer(self.device)
        tissue = SimulatedTissue(self.stiffness, self.kind)
        dice = np.random.default_rng(1)
        up, down = Link(self.link_s, self.lost, dice), Link(self.link_s, self.lost, dice)
        wish = self.wish or (self._press if self.kind == "press" else self._pull)
        step_s = self.device.sample_time
        count = round(self.duration_s / step_s)
        # Anchor of the clutch: where hand and tip start.
        start = wish(0.0)
        device.place[:] = start
        first = device.read()
        tissue.tip[:] = tissue.target[:] = start
        sent: dict[int, tuple[Array, Array]] = {}
        seq = 0
        newest: tuple[int, Array] | None = None
        shown: int | None = None
        frames = 0
        log = Log(step_s, Coupling.of(self.device))
        wrench = np.zeros(6)
        for k in range(count):
            now = k * step_s
            position, rotation = device.read()
            hand = position - first[0]
            model = down.receive(now)
            if isinstance(model, LocalModel):
                commanded = None if model.seq is None else sent.get(model.seq)
                renderer.update(model, commanded)
                if self.naive:
                    wrench = model.wrench
            rendered = renderer.step(hand, rotation)
            if not self.naive:
                wrench = rendered
            # Commands, sixty times a second.
            if k * step_s * TISSUE_HZ >= seq:
                seq += 1
                place, turned = (hand, rotation) if self.naive else renderer.proxy
                sent[seq] = (place, turned)
                vector = between(IDENTITY, turned)
                up.send(now, (seq, np.concatenate([first[0] + place, vector])))
            arrived = up.receive(now)
            if isinstance(arrived, tuple):
                newest = arrived
            if now * TISSUE_HZ >= frames:
                if frames % (TISSUE_HZ // CONTROL_HZ) == 0 and newest is not None:
                    tissue.command(newest[1])
                    shown = newest[0]
                tissue.advance()
                down.send(now, tissue.model(shown))
                frames += 1
            log.add(now, device, renderer, wrench, tissue)
            device.advance(wrench, wish(now) if now < self.release_s else None)
        return log

    def _press(self, time_s: float) -> Array:
        wish = np.zeros(6)
        down = 0.5 - 0.5 * math.cos(math.pi * min(time_s / 0.6, 1.0))
        wish[2] = 0.01 - 0.02 * down
        if time_s > 0.8:
            wish[2] += 0.003 * math.sin(2 * math.pi * 2.5 * (time_s - 0.8))
        return wish

    def _pull(self, time_s: float) -> Array:
        wish = -self._press(time_s)
        wish[2] += 0.01
        wish[4] = 20.0 * wish[2]
        return wish


@dataclass
class Log:
    """What happened in a trial, one row a sample."""

    step_s: float
    coupling: Coupling
    time: list[float] = field(default_factory=list)
    place: list[Array] = field(default_factory=list)
    rendered: list[Array] = field(default_factory=list)
    tip_force: list[Array] = field(default_factory=list)
    elastic: list[Array] = field(default_factory=list)
    #: Energies (J): `SimulatedDevice.active`, kinetic of the device, of the tissue.
    active: list[float] = field(default_factory=list)
    moving: list[float] = field(default_factory=list)
    tissue: list[float] = field(default_factory=list)
    share: list[float] = field(default_factory=list)

    def add(
        self,
        time_s: float,
        device: SimulatedDevice,
        renderer: Renderer,
        wrench: Array,
        tissue: SimulatedTissue,
    ) -> None:
        """A row."""
        self.time.append(time_s)
        self.place.append(device.place.copy())
        self.rendered.append(wrench.copy())
        self.tip_force.append(tissue.force)
        self.elastic.append(tissue.elastic(device.place))
        self.active.append(device.active)
        self.moving.append(device.moving)
        self.tissue.append(tissue.energy)
        self.share.append(renderer.share)
