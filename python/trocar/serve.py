"""Serves a Python policy over openpi's WebSocket protocol, which `trocar evaluate` and robots speak.

    python -m trocar.serve FILE.py:NAME [--host 127.0.0.1] [--port 8000] [--until-eof]
    python -m trocar.serve MODULE:NAME

NAME in the file FILE.py (whose folder is searched for what it imports), or in MODULE (the current folder is searched too), is one of

- an object with `infer(obs) -> {"actions": array}` and, if it keeps anything between chunks, `reset()`;
- a class of such objects, or a function without parameters that makes one;
- a function of the observation that gives the actions, as an array or as `{"actions": array}`.

Actions are a chunk (steps, numbers); a single row is taken as a chunk of one. The address, `ws://HOST:PORT`, is the first line on
standard output. `trocar evaluate SCENE --policy python:FILE.py:NAME` (or `python:MODULE:NAME`) starts this by itself, with the interpreter that
`$TROCAR_PYTHON` names (`python3` if it is not set).

Messages are MessagePack with arrays as maps of bytes, type and shape; nothing is ever unpickled. The server listens on this
machine alone unless `--host` says otherwise: whoever reaches it may use the policy. It needs `pip install .[policies]`.
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
from pathlib import Path
from types import ModuleType
from typing import Any, Callable

import msgpack
import numpy as np

#: Longest message [bytes].
MAX_MESSAGE = 64 * 1024 * 1024
#: Kinds of numbers that arrays may have, as NumPy names them.
_KINDS = "biuf"


def pack(value: Any) -> bytes:
    """`value` (maps, lists, text, numbers, NumPy arrays) as a message."""
    return msgpack.packb(value, default=_pack_array, use_bin_type=True)


def unpack(message: bytes) -> Any:
    """The inverse of `pack`; a message that is none is a `ValueError`."""
    try:
        # No length in it may be beyond the message's own: unpackb sees to that.
        return msgpack.unpackb(message, raw=False, strict_map_key=False, object_hook=_unpack_array)
    except (
        msgpack.exceptions.UnpackException,
        msgpack.exceptions.ExtraData,
        UnicodeDecodeError,
    ) as why:
        raise ValueError(f"the message is no MessagePack: {why or type(why).__name__}") from why


def _pack_array(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in _KINDS:
        raise ValueError(
            f"an array of type {value.dtype} cannot be sent; numbers and truth values can"
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
        # A copy: policies may write into what they are given.
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
        raise ValueError(f"an array of the message has type '{name:.20}', which is none") from why
    if kind.kind not in _KINDS or kind.hasobject:
        raise ValueError(
            f"an array of the message has type '{name:.20}'; numbers and truth values are taken"
        )
    return kind


class Served:
    """A policy as it is served: `infer` gives a reply, `reset` begins an episode."""

    def __init__(self, policy: Any):
        if inspect.isclass(policy) or (_is_function(policy) and not _parameters(policy)):
            policy = policy()
        infer = getattr(policy, "infer", policy)
        if not callable(infer):
            raise TypeError(
                f"a {type(policy).__name__} is no policy: it has no infer(obs) and cannot be called"
            )
        self._infer: Callable[[Any], Any] = infer
        self._reset: Callable[[], Any] | None = getattr(policy, "reset", None)

    def reset(self) -> None:
        """Forgets the episode before."""
        if callable(self._reset):
            self._reset()

    def infer(self, observation: dict[str, Any]) -> dict[str, Any]:
        """The reply to an observation, with the time that the policy took."""
        begun = time.perf_counter()
        reply = self._infer(observation)
        spent = 1e3 * (time.perf_counter() - begun)
        if not isinstance(reply, dict):
            reply = {"actions": reply}
        if "actions" not in reply:
            raise ValueError(
                f"the policy's reply has no 'actions', only {', '.join(map(str, reply)) or 'nothing'}"
            )
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
    """The policy `FILE.py:NAME` or `MODULE:NAME`; names may have dots.

    ValueError for what names none, FileNotFoundError or ImportError for what is not there; whatever the file itself raises.
    """
    # The last colon: a path may have one after its drive.
    place, colon, name = source.rpartition(":")
    if not (place and colon and name):
        raise ValueError(f"'{source}' names no policy; FILE.py:NAME or MODULE:NAME is wanted")
    value: Any = _file(Path(place)) if place.endswith(".py") else _module(place)
    for part in name.split("."):
        if not hasattr(value, part):
            raise AttributeError(f"there is no {name} in {place}")
        value = getattr(value, part)
    return Served(value)


def _module(name: str) -> ModuleType:
    if "" not in sys.path and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    return importlib.import_module(name)


def _file(path: Path) -> ModuleType:
    """The module that a file is, whatever it is called and wherever it lies."""
    path = path.resolve()
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    # What lies beside it can be imported, as when Python runs it.
    sys.path.insert(0, str(path.parent))
    # A file may be called like a module that is there already.
    name = f"policy_{path.stem}" if path.stem in sys.modules else path.stem
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def serve(
    policy: Served,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    told: Callable[[str], None] | None = None,
) -> None:
    """Serves until it is interrupted. `told` is given the address once it listens. Requests are answered one after the other."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve as listen

    turn = threading.Lock()

    def handle(connection: Any) -> None:
        try:
            connection.send(pack({"server": "trocar.serve"}))
            while True:
                message = connection.recv()
                if isinstance(message, str):
                    raise ValueError("a text message is no observation")
                observation = unpack(message)
                if not isinstance(observation, dict):
                    raise ValueError("the message is no map")
                with turn:
                    endpoint = observation.pop("endpoint", "infer")
                    if endpoint == "reset":
                        policy.reset()
                        reply: Any = "reset successful"
                    else:
                        # openpi's protocol has no reset; the first step of an episode is one.
                        if observation.get("episode/step") == 0:
                            policy.reset()
                        reply = pack(policy.infer(observation))
                connection.send(reply)
        except ConnectionClosed:
            pass
        except Exception:
            # The client tells the last line; the whole goes to this process's own output, too.
            said = traceback.format_exc()
            print(said, file=sys.stderr, flush=True)
            try:
                connection.send(said)
                connection.close(1011, "the policy failed")
            except ConnectionClosed:
                pass

    with listen(handle, host, port, max_size=MAX_MESSAGE, compression=None) as server:
        if told is not None:
            place = server.socket.getsockname()
            told(
                f"ws://[{place[0]}]:{place[1]}"
                if ":" in place[0]
                else f"ws://{place[0]}:{place[1]}"
            )
        server.serve_forever()


def _end_with_input() -> None:
    """Ends this process at the end of its standard input: whoever held the other end is gone, killed or not."""
    # The descriptor itself: a buffered reader that a thread is in blocks the interpreter's own end.
    try:
        while os.read(0, 4096):
            pass
    except OSError:
        # Closed before we began: nobody holds it.
        pass
    os._exit(0)


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.serve", description=__doc__.splitlines()[0]
    )
    parser.add_argument(
        "policy",
        metavar="FILE.py:NAME|MODULE:NAME",
        help="a callable, a class, or an object with infer(obs)",
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen at (default %(default)s: this machine alone)",
    )
    parser.add_argument(
        "--port", type=int, default=8000, help="0 for any that is free (default %(default)s)"
    )
    parser.add_argument(
        "--until-eof",
        action="store_true",
        help="end when standard input does, as the process behind it has ended",
    )
    options = parser.parse_args(arguments)
    if options.until_eof:
        threading.Thread(target=_end_with_input, daemon=True).start()
    # What a policy prints while it is imported must not stand before the address.
    out, sys.stdout = sys.stdout, sys.stderr
    try:
        policy = load(options.policy)
    except KeyboardInterrupt:
        return 0
    except Exception as why:
        traceback.print_exc()
        # The last line is what the program that started this tells.
        print(f"{type(why).__name__}: {' '.join(str(why).split())}", file=sys.stderr)
        return 1
    try:
        serve(
            policy,
            options.host,
            options.port,
            told=lambda address: print(address, file=out, flush=True),
        )
    except KeyboardInterrupt:
        return 0
    except OSError as why:
        print(f"error: {options.host}:{options.port}: {why}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
