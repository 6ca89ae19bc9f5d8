"""Teleoperation: instruments in the hands of a device, over the wire of `trocar view`.

>>> with trocar.teleop.launch("cell-a", "--policy", "operator") as session:
...     session.ready()
...     left = session.arm("left")
...     pose = left.setpoint_cp()

- `connect`, `launch`, `Session`, `Arm`: the commands and measurements of CRTK.
- `HapticLoop`, `Device`, `DeviceState`, `DeviceProperties`: a device with force, at 1 kHz.
- `Renderer`, `Coupling`, `LocalModel`: the force itself, without a connection.
- `trocar.teleop.simulated`: a device, a hand and tissue that do not exist.

It needs `pip install '.[teleop]'`. The guide: docs/guides/teleoperation.md.
"""

from .coupling import Coupling, DeviceProperties
from .loop import Device, DeviceState, HapticLoop
from .render import LocalModel, Renderer
from .session import Arm, Session, connect, launch
from .wire import Message, TeleopError

__all__ = [
    "Arm",
    "Coupling",
    "Device",
    "DeviceProperties",
    "DeviceState",
    "HapticLoop",
    "LocalModel",
    "Message",
    "Renderer",
    "Session",
    "TeleopError",
    "connect",
    "launch",
]
