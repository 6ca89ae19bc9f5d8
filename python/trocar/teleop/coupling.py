"""How stiff a haptic device may be coupled to what it touches.

A device is a mass with friction. It is read every sample time T, and its force is held in between:
a spring of stiffness K that is rendered so gives the hand K T / 2 more damping than a real one
takes. A device of damping b (N s/m) stays passive in any hand while

    b >= K (T / 2 + d)

with d the delay between reading the position and the force of it (Colgate and Schenkel 1997,
"Passivity of a class of sampled-data systems"; the delay as in their equation (22) with
H(z) = K z^-n, for which the supremum is at zero frequency). Softer tissue than K is felt as it is,
stiffer tissue as K: the virtual coupling (Colgate, Stanley and Brown 1995, "Issues in the haptic
display of tool use").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Share of a device's damping that the coupling uses up. The rest is a margin.
USED_DAMPING = 0.8


@dataclass(frozen=True)
class DeviceProperties:
    """What the force depends on in a device. Take the least mass and damping of its workspace."""

    #: Mass at the hand (kg).
    mass: float
    #: Viscous friction of the device (N s/m), without the hand's.
    damping: float
    #: Greatest force (N).
    max_force: float
    #: Moment of inertia at the hand (kg m2).
    inertia: float = 0.0
    #: Viscous friction of its rotation (N m s/rad).
    rotational_damping: float = 0.0
    #: Greatest torque (N m); 0 for a device that has no motors for rotation.
    max_torque: float = 0.0
    #: Interval at which it is read and driven (s).
    sample_time: float = 1e-3
    #: From reading a position to the force of it at the hand (s): an upper bound.
    delay: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "max_force", "sample_time"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be above 0")
        if not 0.0 <= self.delay <= 0.1:
            raise ValueError(f"delay is {self.delay} s; it must be in [0, 0.1]")
        if self.max_torque > 0.0 and not (self.inertia > 0.0 and self.rotational_damping > 0.0):
            raise ValueError(
                "a device with torque needs an inertia and a rotational_damping above 0"
            )

    @property
    def delay_samples(self) -> int:
        """The delay in samples."""
        return round(self.delay / self.sample_time)


@dataclass(frozen=True)
class Coupling:
    """The springs between the hand and the instrument, and the damping that pays for them."""

    #: N/m, and N m/rad (0: rotation is not felt).
    stiffness: float
    rotational_stiffness: float
    #: Damping of the device that sampling and delay use up: N s/m, and N m s/rad.
    paid: float
    rotational_paid: float

    @classmethod
    def of(cls, device: DeviceProperties) -> Coupling:
        """The stiffest coupling of a device that stays passive, and does not ring between samples.

        The second limit is K <= m / (T / 2 + d)^2: an oscillation of the mass on the spring takes
        at least 2 pi times as long as the loop. It binds for light devices of much friction.
        """
        lag = 0.5 * device.sample_time + device.delay_samples * device.sample_time

        def stiffness(mass: float, damping: float) -> float:
            return min(USED_DAMPING * damping / lag, mass / lag**2)

        linear = stiffness(device.mass, device.damping)
        angular = 0.0
        if device.max_torque > 0.0:
            angular = stiffness(device.inertia, device.rotational_damping)
        return cls(linear, angular, linear * lag, angular * lag)
