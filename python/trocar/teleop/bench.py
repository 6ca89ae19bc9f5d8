"""Measures what of the force of tissue reaches a hand: `python -m trocar.teleop.bench`.

A simulated hand presses into tissue, or pulls on tissue that the jaws hold, moves to and fro, and
lets go (`simulated.Trial`). Printed as a table of Markdown; the measurement has no clock in it, so
the numbers are the same everywhere.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace

import numpy as np

from .simulated import DEVICE, Log, Trial

#: Young's moduli (Pa), and the length by which they become stiffnesses (m).
MODULI = (3e3, 1e4, 3e4, 1e5, 3e5, 1e6)
SIZE = 0.01
#: When the hand works: the force is compared then (s).
WORKS_S = (0.4, 2.0)


@dataclass(frozen=True)
class Result:
    """Figures of a trial. Forces (N) are root mean squares, energies (J) greatest values."""

    #: Of tissue on the simulated instrument; on the hand; their difference.
    tissue: float
    hand: float
    error: float
    #: The difference between the force on the hand and that of a coupling to the same tissue
    #: without delay, at rest: what delay and passivity take away.
    ideal: float
    ideal_error: float
    #: What the forces gave to the hand beyond what the device's own friction took.
    active: float
    #: Kinetic and elastic energy when the hand lets go, and the kinetic energy at the end.
    released: float
    moving: float
    end: float


def measure(trial: Trial) -> Result:
    """Runs a trial."""
    log = trial.run()
    time = np.array(log.time)
    works = (time >= WORKS_S[0]) & (time < min(WORKS_S[1], trial.release_s))
    free = time >= trial.release_s
    hand = np.array(log.rendered)[works, 2]
    tissue = np.array(log.tip_force)[works, 2]
    # The series of coupling and tissue.
    coupling = log.coupling.stiffness
    ideal = np.array(log.elastic)[works, 2] * coupling / (coupling + trial.stiffness)
    moving = np.array(log.moving)
    return Result(
        _rms(tissue),
        _rms(hand),
        _rms(hand - tissue),
        _rms(ideal),
        _rms(hand - ideal),
        max(log.active),
        _released(log, int(np.argmax(free)), coupling),
        float(moving[free].max()),
        float(moving[-1]),
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _released(log: Log, at: int, coupling: float) -> float:
    """Kinetic energy of the device and elastic energy of coupling and tissue at a sample (J)."""
    force = float(np.linalg.norm(log.rendered[at][:3]))
    return log.moving[at] + log.tissue[at] + 0.5 * force**2 / coupling


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.teleop.bench", description="What of the force reaches a hand."
    )
    parser.add_argument("--link-ms", type=float, nargs="+", default=[1.0, 10.0, 30.0])
    parser.add_argument("--device-ms", type=float, nargs="+", default=[1.0, 30.0])
    parser.add_argument("--lost", type=float, default=0.1, help="share of messages that are lost")
    options = parser.parse_args(arguments)
    print(
        "| what | tissue (kPa) | connection (ms) | device (ms) | tissue (N) | hand (N) | "
        "difference (N) | without delay (N) | difference (N) | given (mJ) |"
    )
    print("|---" * 10 + "|")
    for kind in ("press", "hold"):
        for device_ms in options.device_ms:
            device = replace(DEVICE, delay=1e-3 * device_ms)
            for link_ms in options.link_ms:
                for modulus in MODULI:
                    trial = Trial(modulus * SIZE, kind, 1e-3 * link_ms, options.lost, device)
                    r = measure(trial)
                    print(
                        f"| {kind} | {1e-3 * modulus:g} | {link_ms:g} | {device_ms:g} | "
                        f"{r.tissue:.2f} | {r.hand:.2f} | {r.error:.2f} | {r.ideal:.2f} | "
                        f"{r.ideal_error:.2f} | {1e3 * r.active:.3f} |",
                        flush=True,
                    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
