"""The force on the hand, a thousand times a second, from tissue that is known sixty times.

The simulation sends a local model of the tissue at the instrument: a pose, the force there, and a
6 x 6 stiffness (Adachi, Kumano and Ogino 1995, "Intermediate representation for stiff virtual
objects"). Between two messages the instrument is a proxy (Zilles and Salisbury 1995, "A
constraint-based god-object method"; with rotation as Ortega, Redon and Coquillart 2007) that rests
where the force of the model and that of the virtual coupling are equal:

    F = K (K + S)^-1 (f - S d)

with K the coupling, d the motion of the hand since the model's pose, f and S the model. F is the
force of a spring that is never stiffer than K. The proxy, not the hand, is what the simulated
instrument follows, so that tissue is pressed with the force that the hand feels.

Models come late, get lost, and differ from the tissue. Three rules keep the hand passive whatever
arrives:

- A new model changes the force continuously: the difference to the old force fades within
  `FADE_S`. So does the force of a model that is older than `LIFE_S`.
- An observer adds up the energy that the hand has given (Hannaford and Ryu 2002, "Time-domain
  passivity control of haptic interfaces"), with the forces that the device really applied. Of the
  device's own friction it counts what the coupling was chosen by (`Coupling.paid`).
- The controller scales the force down where the energy in the coupling's spring, F^2 / 2 K, is more
  than the hand has given. The energy that is kept has an upper bound, twice what the model stores,
  so that tissue that takes energy does not give later models a credit (Franken et al. 2011,
  "Bilateral telemanipulation with time delays: a two-layer approach").

So a model that appears around a hand that is inside of tissue already pushes no faster than the
hand pushes: it is a wall where it was met.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from .coupling import Coupling, DeviceProperties
from .rotation import IDENTITY, Array, between, from_vector, multiply

#: Time in which the difference to an older model fades by a factor of e (s).
FADE_S = 5e-3
#: Age at which a model is not believed any more (s): that of a command of the wire.
LIFE_S = 0.125
#: Time constant of what is taken for a lasting difference between command and tip (s).
BIAS_S = 0.3
#: Least stiffness by which the energy in a model is estimated: N/m, N m/rad.
LEAST_STIFFNESS = (10.0, 1e-3)
#: Length by which rotations are compared with translations (m).
LENGTH = 0.01


@dataclass(frozen=True)
class LocalModel:
    """The tissue at an instrument, in the cell's axes: a message `haptic`."""

    #: Position (m) and quaternion of the tip.
    position: Array
    rotation: Array
    #: Force (N) and torque (N m) of tissue on the instrument, about the tip, (6,).
    wrench: Array
    #: Their decrease by translation (m) and rotation vector (rad), (6, 6).
    stiffness: Array
    #: Number of the newest command that it shows, if any.
    seq: int | None = None
    #: Where that command sends the tip, if known: position and quaternion.
    setpoint: tuple[Array, Array] | None = None


def positive(stiffness: Array) -> Array:
    """The nearest symmetric positive semidefinite stiffness. The solver's is so up to rounding."""
    scale = np.array([1.0, 1.0, 1.0, LENGTH, LENGTH, LENGTH])
    scaled = 0.5 * (stiffness + stiffness.T) / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    whole = (vectors * np.maximum(values, 0.0)) @ vectors.T
    result: Array = whole * np.outer(scale, scale)
    return result


class Renderer:
    """The force of one device, in the cell's axes. Call `step` once every sample time.

    Positions are those of the hand since the clutch was pressed (m), rotations likewise. `scale` is
    the motion of the instrument over that of the hand, `gain` the force on the hand over that of
    tissue. Power is the same on both sides if they are equal.
    """

    def __init__(
        self,
        device: DeviceProperties,
        *,
        scale: float = 1.0,
        gain: float = 1.0,
        coupling: Coupling | None = None,
    ):
        self.device, self.scale, self.gain = device, scale, gain
        self.coupling = coupling or Coupling.of(device)
        k, kr = self.coupling.stiffness, self.coupling.rotational_stiffness
        self._k = np.array([k, k, k, kr, kr, kr])
        self._turns = kr > 0.0
        self._compliance = np.divide(1.0, self._k, out=np.zeros(6), where=self._k > 0.0)
        paid, turning = self.coupling.paid, self.coupling.rotational_paid
        self._paid = np.array([paid] * 3 + [turning] * 3) / device.sample_time
        self._fade = math.exp(-device.sample_time / FADE_S)
        self.reset()

    def reset(self) -> None:
        """The clutch is pressed: the hand and the proxy are at their starts, without force."""
        #: Energy that the hand has given and may get back (J).
        self.energy = 0.0
        #: The share of the model's force that the last step rendered.
        self.share = 1.0
        self.wrench = np.zeros(6)
        #: Where the hand is, and the proxy: positions and quaternions.
        self.hand = (np.zeros(3), IDENTITY)
        self.proxy = (np.zeros(3), IDENTITY)
        self._bias: Array | None = None
        self._pending: deque[Array] = deque([np.zeros(6)] * self.device.delay_samples)
        self._drop()
        self._offset = np.zeros(6)

    def _drop(self) -> None:
        """No tissue."""
        self._at = self.hand
        self._lag = np.zeros(6)
        self._force, self._stiffness = np.zeros(6), np.zeros((6, 6))
        self._series, self._stores = np.zeros((6, 6)), np.zeros((6, 6))
        self._age = math.inf

    def update(
        self, model: LocalModel | None, commanded: tuple[Array, Array] | None = None
    ) -> None:
        """Takes a model; None: there is no tissue, or no clutch.

        `commanded`: the proxy (position, quaternion) of the command `model.seq`, as it was sent.
        Without it the model counts from where the proxy is now.
        """
        if model is None:
            self._drop()
        else:
            self._take(model, commanded or self.proxy)
        # The force goes on where it is.
        self._offset = self.wrench - self._target()[0]

    def _take(self, model: LocalModel, commanded: tuple[Array, Array]) -> None:
        # The tip lags behind the command. What lasts of it (an arm that yields, a rotation that it
        # cannot do) is no motion to come.
        ratio = self.gain / self.scale
        size = np.array([self.scale] * 3 + [1.0] * 3)
        lag: Array = np.zeros(6)
        if model.setpoint is not None:
            lag[:3] = (model.setpoint[0] - model.position) / self.scale
            lag[3:] = between(model.rotation, model.setpoint[1])
        if self._bias is None:
            self._bias = lag
        share = min(1.0, min(self._age, LIFE_S) / BIAS_S)
        self._bias = self._bias + share * (lag - self._bias)
        self._at, self._lag = commanded, lag - self._bias
        # In lengths of the hand.
        self._force = ratio * size * model.wrench
        stiffness: Array = ratio * positive(model.stiffness) * np.outer(size, size)
        self._stiffness = stiffness
        self._series = self._coupled(stiffness)
        least = np.repeat(LEAST_STIFFNESS, 3)
        self._stores = np.asarray(np.linalg.inv(stiffness + np.diag(least)))
        self._age = 0.0

    def _coupled(self, stiffness: Array) -> Array:
        """K (K + S)^-1, of the directions that the device feels."""
        felt = slice(0, 6 if self._turns else 3)
        k = np.diag(self._k[felt])
        series = np.zeros((6, 6))
        series[felt, felt] = k @ np.linalg.inv(k + stiffness[felt, felt])
        return series

    def _target(self) -> tuple[Array, Array]:
        """The force on a hand that could have any, and the model's own force at the hand."""
        motion = self._lag.copy()
        motion[:3] += self.hand[0] - self._at[0]
        motion[3:] += between(self._at[1], self.hand[1])
        own = self._force - self._stiffness @ motion
        return self._series @ own, own

    def step(self, position: Array, rotation: Array = IDENTITY) -> Array:
        """The force (N) and torque (N m) on the hand that is here now, (6,)."""
        device = self.device
        moved = np.concatenate([position - self.hand[0], between(self.hand[1], rotation)])
        self.hand = (position, rotation)
        self._pending.append(self.wrench)
        applied = self._pending.popleft()
        self.energy += float((self._paid * moved - applied) @ moved)
        self._age += device.sample_time
        if LIFE_S < self._age < math.inf:
            self.update(None)
        target, own = self._target()
        self._offset *= self._fade
        wrench = target + self._offset
        for part, most in ((slice(0, 3), device.max_force), (slice(3, 6), device.max_torque)):
            size = float(np.linalg.norm(wrench[part]))
            if size > most:
                wrench[part] *= most / size
        # The energy in the coupling, and in all of it and the tissue.
        spring = 0.5 * float(wrench @ (self._compliance * wrench))
        stored = spring + float(own @ self._stores @ own)
        self.energy = min(self.energy, stored)
        self.share = 1.0
        if spring > max(self.energy, 0.0):
            self.share = math.sqrt(max(self.energy, 0.0) / spring)
            wrench *= self.share
        self.wrench = wrench
        # Where the model is at rest, whatever share of it the hand feels.
        yields = self._compliance * target
        turned = multiply(from_vector(yields[3:]), rotation) if self._turns else rotation
        self.proxy = (position + yields[:3], turned)
        return wrench
