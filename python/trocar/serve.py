"""Serves a Python policy over openpi's WebSocket protocol.

`trocar evaluate` and robots speak this protocol.

    python -m trocar.serve FILE.py:NAME [--host 127.0.0.1] [--port 8000] [--until-eof]
    python -m trocar.serve MODULE:NAME

NAME is an attribute of the file FILE.py, or of MODULE. The file's folder is searched for the
modules that it imports; for MODULE the current folder is searched too. NAME is one of

- an object with `infer(obs) -> {"actions": array}` and, if it keeps a state, `reset()`;
- a class of such objects, or a function without parameters that returns one;
- a function of the observation that returns the actions, as an array or as `{"actions": array}`.

Actions are a chunk (steps, numbers). A single row (numbers,) is a chunk of one. The first line on
standard output is the address, `ws://HOST:PORT`. `trocar evaluate SCENE --policy
python:FILE.py:NAME` (or `python:MODULE:NAME`) starts this server by itself, with the interpreter in
`$TROCAR_PYTHON` (default: `python3`).

Messages are MessagePack. An array is a map of bytes, type and shape; nothing is unpickled. The
server listens on this machine only, unless `--host` says otherwise: everyone who reaches it can use
the policy. It needs `pip install '.[policies]'`.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import inspect
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

try:
    import msgpack
    import websockets.sync.server
    from websockets.exceptions import ConnectionClosed
except ImportError as why:
    MISSING = f"trocar.serve needs the extra 'policies' ({why}); run pip install '.[policies]'"
    if __name__ == "__main__":
        sys.exit(f"error: {MISSING}")
    raise ModuleNotFoundError(MISSING, name=why.name) from why

#: Maximum size of a message (bytes).
MAX_MESSAGE = 64 * 1024 * 1024
#: Kinds of numbers that arrays may have, as NumPy names them.
_KINDS = "biuf"


class LoadError(ValueError):
    """A source that does not name a policy."""


def pack(value: Any) -> bytes:
    """`value` (maps, lists, text, numbers, NumPy arrays) as a message."""
    message: bytes = msgpack.packb(value, default=_pack_array, use_bin_type=True)
    return message


def unpack(message: bytes) -> Any:
    """The inverse of `pack`. A malformed message is a ValueError."""
    try:
        # unpackb refuses lengths beyond the message's own.
        return msgpack.unpackb(message, raw=False, strict_map_key=False, object_hook=_unpack_array)
    except (
        msgpack.exceptions.UnpackException,
        msgpack.exceptions.ExtraData,
        UnicodeDecodeError,
    ) as why:
        raise ValueError(f"the message is not MessagePack: {why or type(why).__name__}") from why


def _pack_array(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in _KINDS:
        raise ValueError(
            f"an array of type {value.dtype} cannot be sent; it must be of numbers or booleans"
        )
    if isinstance(value, np.ndarray):
        return {
            b"__ndarray__": True,
            b"data": value.tobytes(),
            b"dtype": value.dtype.str,
            b"shape": value.shape,
        }
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(
        f"a {type(value).__name__} cannot be sent; maps, lists, text, numbers and arrays can"
    )


def _unpack_array(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        kind = _dtype(value.get(b"dtype"))
        data, shape = value.get(b"data"), value.get(b"shape")
        if (
            not isinstance(data, bytes)
            or not isinstance(shape, list)
            or not all(isinstance(n, int) and n >= 0 for n in shape)
        ):
            raise ValueError("an array of the message lacks its data or shape")
        # A copy, because policies may write into their observation.
        return np.frombuffer(data, kind).reshape(shape).copy()
    if b"__npgeneric__" in value:
        return _dtype(value.get(b"dtype")).type(value.get(b"data"))
    return value


def _dtype(name: Any) -> np.dtype:
    if not isinstance(name, str):
        raise ValueError("an array of the message has no type")
    try:
        kind = np.dtype(name)
    except TypeError as why:
        raise ValueError(
            f"an array of the message has type '{name:.20}', which NumPy does not know"
        ) from why
    if kind.kind not in _KINDS or kind.hasobject:
        raise ValueError(
            f"an array of the message has type '{name:.20}'; it must be of numbers or booleans"
        )
    return kind


class Served:
    """A policy with the two calls of the protocol: `infer` and `reset`."""

    def __init__(self, policy: Any):
        if inspect.isclass(policy) or (_is_function(policy) and not _parameters(policy)):
            policy = policy()
        infer = getattr(policy, "infer", policy)
        if not callable(infer):
            kind = type(policy).__name__
            raise LoadError(f"a {kind} is not a policy: it has no infer(obs) and is not callable")
        self._infer: Callable[[Any], Any] = infer
        self._reset: Callable[[], Any] | None = getattr(policy, "reset", None)

    def reset(self) -> None:
        """Starts an episode."""
        if callable(self._reset):
            self._reset()

    def infer(self, observation: dict[str, Any]) -> dict[str, Any]:
        """The reply to an observation.

        `actions`: float64 (steps, numbers). `server_timing`: the policy's time (ms).
        """
        begun = time.perf_counter()
        reply = self._infer(observation)
        spent = 1e3 * (time.perf_counter() - begun)
        if not isinstance(reply, dict):
            reply = {"actions": reply}
        if "actions" not in reply:
            keys = ", ".join(map(str, reply)) or "nothing"
            raise ValueError(f"the policy's reply must have 'actions'; it has {keys}")
        actions = np.asarray(reply["actions"], np.float64)
        return reply | {
            "actions": actions[None] if actions.ndim == 1 else actions,
            "server_timing": {"infer_ms": spent},
        }


def _is_function(value: Any) -> bool:
    return inspect.isfunction(value) or inspect.isbuiltin(value)


def _parameters(function: Any) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return [inspect.Parameter("obs", inspect.Parameter.POSITIONAL_ONLY)]


def load(source: str) -> Served:
    """The policy `FILE.py:NAME` or `MODULE:NAME`. NAME may have dots.

    LoadError where `source` does not name a policy; otherwise whatever the policy's code raises.
    """
    # The last colon: a Windows path has one after its drive.
    place, colon, name = source.rpartition(":")
    if not (place and colon and name):
        raise LoadError(f"'{source}' must be FILE.py:NAME or MODULE:NAME")
    value: Any = _import_file(Path(place)) if place.endswith(".py") else _import_module(place)
    for part in name.split("."):
        if not hasattr(value, part):
            raise LoadError(f"there is no {name} in {place}")
        value = getattr(value, part)
    return Served(value)


def _import_module(name: str) -> ModuleType:
    if "" not in sys.path and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as why:
        # A module that the policy's module imports is the policy's own error.
        if why.name is None or not f"{name}.".startswith(f"{why.name}."):
            raise
        raise LoadError(f"there is no module {name} ({why})") from why


def _import_file(path: Path) -> ModuleType:
    """Imports a file as a module, whatever its name and folder."""
    path = path.resolve()
    if not path.is_file():
        raise LoadError(f"there is no file {path}")
    # Modules beside it can be imported, as when Python runs it.
    sys.path.insert(0, str(path.parent))
    # A file may have the name of a module that is imported already.
    name = f"policy_{path.stem}" if path.stem in sys.modules else path.stem
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise LoadError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _print_load_error(why: Exception) -> None:
    """Prints why a policy cannot be loaded: where its own code raised, then one line that says all.

    `trocar` shows the last line.
    """
    message = " ".join(str(why).split())
    if not isinstance(why, LoadError):
        own = [__file__, importlib.__file__]
        frames = [
            frame
            for frame in traceback.extract_tb(why.__traceback__)
            if frame.filename not in own and not frame.filename.startswith("<")
        ]
        print("".join(traceback.format_list(frames)), end="", file=sys.stderr)
        message = f"{type(why).__name__}: {message}"
    print(f"error: {message}", file=sys.stderr)


def serve(
    policy: Served,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    on_listening: Callable[[str], None] | None = None,
) -> None:
    """Serves until interrupted. Answers one request after the other.

    `port`: 0 for any free port. `on_listening` is called with the address once it listens. OSError
    where the address cannot be used.
    """
    one_request = threading.Lock()

    def handle(connection: Any) -> None:
        try:
            connection.send(pack({"server": "trocar.serve"}))
            while True:
                message = connection.recv()
                if isinstance(message, str):
                    raise ValueError(
                        "the message is text; it must be an observation in MessagePack"
                    )
                observation = unpack(message)
                if not isinstance(observation, dict):
                    raise ValueError("the message is not a map")
                with one_request:
                    endpoint = observation.pop("endpoint", "infer")
                    if endpoint == "reset":
                        policy.reset()
                        reply: Any = "reset successful"
                    else:
                        # openpi's protocol has no reset: the first step of an episode is one.
                        if observation.get("episode/step") == 0:
                            policy.reset()
                        reply = pack(policy.infer(observation))
                connection.send(reply)
        except ConnectionClosed:
            pass
        except Exception:
            # The client shows the last line.
            text = traceback.format_exc()
            print(text, file=sys.stderr, flush=True)
            try:
                connection.send(text)
                connection.close(1011, "the policy raised an exception")
            except ConnectionClosed:
                pass

    with websockets.sync.server.serve(
        handle, host, port, max_size=MAX_MESSAGE, compression=None
    ) as server:
        if on_listening is not None:
            address, number = server.socket.getsockname()[:2]
            address = f"[{address}]" if ":" in address else address
            on_listening(f"ws://{address}:{number}")
        server.serve_forever()


def _exit_at_end_of_input() -> None:
    """Ends this process at the end of its standard input: the process at the other end is gone."""
    # The descriptor itself: a thread in a buffered reader blocks the interpreter's exit.
    try:
        while os.read(0, 4096):
            pass
    except OSError:
        # It was closed before this began: no process holds it.
        pass
    os._exit(0)


def _port(text: str) -> int:
    """A port number of the command line."""
    if not (text.isdecimal() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"'{text}' must be an integer in [0, 65535]")
    return int(text)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit status."""
    description = "Serves a Python policy over openpi's WebSocket protocol."
    parser = argparse.ArgumentParser(prog="python -m trocar.serve", description=description)
    add = parser.add_argument
    add(
        "policy",
        metavar="FILE.py:NAME|MODULE:NAME",
        help="a callable, a class, or an object with infer(obs)",
    )
    add(
        "--host",
        default="127.0.0.1",
        help="address to listen at (default %(default)s: this machine only)",
    )
    add("--port", type=_port, default=8000, help="0 for any free port (default %(default)s)")
    add(
        "--until-eof",
        action="store_true",
        help="end when standard input ends, because the process behind it has ended",
    )
    add("--check", action="store_true", help="load the policy and exit, without serving it")
    options = parser.parse_args(arguments)
    if options.until_eof:
        threading.Thread(target=_exit_at_end_of_input, daemon=True).start()
    # Nothing that a policy prints while it is imported may come before the address.
    out, sys.stdout = sys.stdout, sys.stderr
    try:
        policy = load(options.policy)
    except KeyboardInterrupt:
        return 0
    except Exception as why:
        _print_load_error(why)
        return 1
    if options.check:
        return 0

    def print_address(address: str) -> None:
        print(address, file=out, flush=True)

    try:
        serve(policy, options.host, options.port, on_listening=print_address)
    except KeyboardInterrupt:
        return 0
    except (OSError, UnicodeError) as why:
        print(f"error: cannot listen at {options.host}:{options.port}: {why}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
