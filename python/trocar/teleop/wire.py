"""The wire of `trocar view` (docs/guides/view-wire.md): JSON texts and binary messages.

`Wire` connects and takes messages apart. `trocar.teleop.Session` is what programs use.
"""

from __future__ import annotations

import json
import threading
from contextlib import ExitStack
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

try:
    import websockets.sync.client
    from websockets.exceptions import ConnectionClosed, WebSocketException
except ImportError as why:
    raise ModuleNotFoundError(
        f"trocar.teleop needs the extra 'teleop' ({why}); run pip install '.[teleop]'",
        name=why.name,
    ) from why

#: The version that this module speaks.
VERSION = 1
#: Time in which a server must answer (s).
TIMEOUT_S = 20.0
#: Types of numbers of binary messages.
_TYPES = {"f32": "<f4", "u32": "<u4", "u16": "<u2", "u8": "u1"}


class TeleopError(RuntimeError):
    """A refusal of the server, or the end of the connection. `code` is that of the wire."""

    def __init__(self, code: str, message: str):
        super().__init__(message)
        self.code = code


class Message(NamedTuple):
    """A message: its JSON object, and the arrays of a binary one by name."""

    head: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def wire_address(address: str) -> str:
    """The WebSocket of a server: `ws://HOST:PORT/wire/1?token=TOKEN`.

    `address` may also be that of the page, `http://HOST:PORT/?token=TOKEN`.
    """
    parts = urlsplit(address)
    if parts.scheme == "ws":
        return address
    if parts.scheme != "http" or not parts.netloc or "token=" not in parts.query:
        raise ValueError(
            f"'{address}' is no address of trocar view, http://HOST:PORT/?token=TOKEN as it prints"
        )
    return f"ws://{parts.netloc}/wire/{VERSION}?{parts.query}"


def parse(data: str | bytes) -> Message:
    """Takes a message apart. A malformed one is a ValueError."""
    if isinstance(data, str):
        return Message(_object(data), {})
    if len(data) < 4:
        raise ValueError("a binary message is shorter than 4 bytes")
    begin = 4 + int.from_bytes(data[:4], "little")
    if begin > len(data):
        raise ValueError("a binary message is shorter than its header")
    head = _object(data[4:begin].decode())
    arrays = {}
    for name, entry in head.get("arrays", {}).items():
        kind = np.dtype(_TYPES[entry["dtype"]])
        shape = tuple(int(n) for n in entry["shape"])
        count, offset = int(np.prod(shape)), begin + int(entry["offset"])
        if offset + count * kind.itemsize > len(data):
            raise ValueError(f"the array {name} of a message goes beyond its end")
        arrays[name] = np.frombuffer(data, kind, count, offset).reshape(shape)
    return Message(head, arrays)


def _object(text: str) -> dict[str, Any]:
    value = json.loads(text)
    if not isinstance(value, dict) or not isinstance(value.get("type"), str):
        raise ValueError("a message is no JSON object with a type")
    return value


class Wire:
    """A connection. Any thread may send; one receives."""

    def __init__(self, address: str):
        target = wire_address(address)
        place = urlsplit(target).netloc
        self._open = ExitStack()
        try:
            self._socket = self._open.enter_context(
                # The server pings.
                websockets.sync.client.connect(
                    target,
                    max_size=None,
                    compression=None,
                    open_timeout=TIMEOUT_S,
                    ping_interval=None,
                    proxy=None,
                )
            )
        except (OSError, TimeoutError, WebSocketException) as why:
            raise ConnectionError(f"no connection to trocar view at {place}: {why}") from why
        self._lock = threading.Lock()

    def send(self, **message: Any) -> None:
        """Sends a JSON object. TeleopError if the connection is gone."""
        text = json.dumps(message)
        try:
            with self._lock:
                self._socket.send(text)
        except ConnectionClosed as why:
            raise TeleopError("closed", f"the connection is gone: {why}") from why

    def receive(self) -> Message:
        """The next message. TeleopError if the connection is gone."""
        try:
            return parse(self._socket.recv())
        except ConnectionClosed as why:
            raise TeleopError("closed", f"the connection is gone: {why}") from why

    def close(self) -> None:
        """Ends the connection."""
        self._open.close()
