"""Demonstrations by an operator, and a policy that is cloned from them: the whole way.

    pip install '.[teleop,datasets,policies]' torch matplotlib
    python examples/python/demonstrations.py -o lifts

Nobody has to be there: a scripted operator looks at where the organ lies and moves a simulated
haptic device with a hand of limited stiffness that trembles. Its motion goes over the WebSocket of
`trocar view`, as that of a real device would, and the force of tissue comes back and moves the
hand. Ten episodes whose gates are passed are kept. `trocar export` makes a dataset of them,
`train_from_pictures.py --observe states` clones it, and `trocar evaluate` compares the clone with
`scripted` and `noise`, on starts of the arms that no demonstration had.

Nothing is random but the seeds, yet wall time decides when a command arrives: two runs differ.
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from trocar import teleop
from trocar.teleop.rotation import between, matrix
from trocar.teleop.simulated import DEVICE, HeldDevice

HERE = Path(__file__).parent
#: The scene, with time for a human's pace (s).
SCENE, SECONDS = HERE / "lift_from_pictures.toml", 14.0
#: The anatomy does not vary; the arms' starts do, as in `cell-a`.
FIXED = ("--variation", "none")
STARTS = """set = "none"
tilt_deg = { within = 1.0 }
azimuth_deg = { within = 5.0 }
insertion_mm = { within = 5.0 }
roll_deg = { within = 10.0 }"""
#: Way from the jaw's pivot to the middle of what it takes, and way along the shaft by which the
#: operator comes from behind (m).
DEPTH, BACK = 0.0141, 0.025
#: Speed of the hand (m/s), height of the lift (m), and times of closing and holding (s).
SPEED, LIFT = 0.03, 0.0145
CLOSE_S, LIFT_S, HOLD_S = 1.0, 1.5, 3.0
#: The jaws close in this part of the time, and are waited for in the rest.
SNAP = 3.0
#: Trembling of the hand: amplitude (m) and frequency (Hz).
TREMOR, TREMOR_HZ = 3e-4, 9.0


def turn_to(x, y):
    """The quaternion of axes whose x is `x` and whose y is near `y`."""
    x = x / np.linalg.norm(x)
    z = np.cross(x, y)
    z /= np.linalg.norm(z)
    axes = np.stack([x, np.cross(z, x), z], 1)
    # From the largest of the four (Shepperd 1978).
    trace = np.array([np.trace(axes), *np.diag(axes)])
    k = int(trace.argmax())
    skew = np.array([axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]])
    if k == 0:
        quaternion = np.array([1.0 + trace[0], *skew])
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        quaternion = np.zeros(4)
        quaternion[0] = skew[i]
        quaternion[1 + i] = 1.0 + axes[i, i] - axes[j, j] - axes[m, m]
        quaternion[1 + j] = axes[i, j] + axes[j, i]
        quaternion[1 + m] = axes[i, m] + axes[m, i]
    return quaternion / np.linalg.norm(quaternion)


class Operator:
    """Looks at the scene once an episode, and moves the hand."""

    def __init__(self, session, device, loop):
        self.session, self.device, self.loop = session, device, loop
        scene = session.latest["scene"].head
        (port,) = [p for p in scene["ports"] if p["name"] == "left"]
        self.port = np.array(port["centre_m"])
        names = [o["name"] for o in session.latest["organs"].head["organs"]]
        organ = names.index(scene["task"]["organ"])
        # The first frame after a subscription has every organ.
        session.latest.pop("frame", None)
        session.subscribe(frames_hz=5)
        session.wait(lambda: "frame" in session.latest, "a frame")
        session.subscribe(frames_hz=0)
        head, arrays = session.latest["frame"]
        (part,) = [o for o in head["organs"] if o["organ"] == organ]
        self.organ = np.array(part["low"]) + np.array(part["step"]) * arrays[part["positions"]]

    def grasp(self):
        """Tip pose for a grasp at the organ's middle, across it, from the port."""
        middle = self.organ.mean(0)
        along = np.linalg.svd(self.organ - middle, full_matrices=False)[2][0]
        near = np.abs((self.organ - middle) @ along) < 0.004
        point = self.organ[near].mean(0)
        x = point - self.port
        x /= np.linalg.norm(x)
        y = np.cross(along, x)
        # Of the two rolls the one that the wrist is nearer to.
        start = self.loop.arm.setpoint_cp()
        if y @ matrix(start[3:])[:, 1] < 0.0:
            y = -y
        return point - DEPTH * x, turn_to(x, y), x

    def lift(self):
        """One episode. Returns whether its gates are passed."""
        device, arm = self.device, self.loop.arm
        start = arm.setpoint_cp()
        place, turned, x = self.grasp()
        behind = place - BACK * x
        rotation = between(start[3:], turned)
        self.origin, self.home = start[:3], device.simulated.place[:3].copy()
        # Where the hand is: position in the cell, share of the turn, jaw, time.
        up = place + np.array([0.0, 0.0, LIFT])
        ways = [
            (start[:3], behind, (0.0, 1.0), (arm.jaw_setpoint_js(), 1.0), None),
            (behind, place, (1.0, 1.0), (1.0, 1.0), None),
            (place, place, (1.0, 1.0), (1.0, 0.0), CLOSE_S),
            (place, up, (1.0, 1.0), (0.0, 0.0), LIFT_S),
            (up, up, (1.0, 1.0), (0.0, 0.0), HOLD_S),
        ]
        device.clutch = True
        for a, b, share, jaw, given in ways:
            seconds = given or max(0.7, float(np.linalg.norm(b - a)) / SPEED)
            begun = self.now()
            while (done := (self.now() - begun) / seconds) < 1.0:
                if self.session.status.get("passed") or self.session.status.get("end"):
                    break
                eased = done * done * (3.0 - 2.0 * done)
                self.move(
                    a + eased * (b - a), (share[0] + eased * (share[1] - share[0])) * rotation
                )
                device.jaw = jaw[0] + min(1.0, SNAP * done) * (jaw[1] - jaw[0])
                time.sleep(0.004)
        return bool(self.session.status.get("passed"))

    def now(self):
        """Simulated time (s): the hand waits where the program is slow."""
        if why := self.session.ended or self.loop.ended:
            raise SystemExit(f"error: {why}")
        return float(self.session.latest["measured"].head["time_s"])

    def move(self, place, rotation):
        """Where the hand wants to be, which trembles."""
        phase = 2.0 * np.pi * TREMOR_HZ * self.now() + np.array([0.0, 1.0, 2.0])
        self.device.wish = np.concatenate(
            [self.home + place - self.origin + TREMOR * np.sin(phase), rotation]
        )

    def rest(self):
        """Lets go of the clutch."""
        self.device.clutch = False
        self.device.simulated.place[:] = 0.0
        self.device.simulated.rate[:] = 0.0
        self.device.wish = np.zeros(6)


def demonstrate(options):
    """Keeps episodes until there are enough. Returns the next seed, and how many were kept."""
    words = [
        "--policy",
        "operator",
        "--paused",
        "--record",
        str(options.output / "demonstrations"),
        *FIXED,
    ]
    words += ["--threads", str(options.threads), "--speed", str(options.speed)]
    kept, seed = 0, 0
    with teleop.launch(
        str(options.output / "scene.toml"), *words, program=options.program
    ) as session:
        session.ready()
        device = HeldDevice(DEVICE)
        gain = 0.0 if options.no_force else 1.0
        with teleop.HapticLoop(session, "left", device, frame="world", gain=gain) as loop:
            while kept < options.episodes and seed < 3 * options.episodes:
                device.peak = 0.0
                session.latest.pop("measured", None)
                session.play()
                session.wait(lambda: "measured" in session.latest, "a measurement")
                operator = Operator(session, device, loop)
                passed = operator.lift()
                operator.rest()
                session.pause()
                rows = session.history("lift_mm", "follow", "slip_mm")
                reply = session.record("keep" if passed else "discard")
                kept, seed = kept + passed, seed + 1
                told = reply.get("path") or "discarded"
                print(
                    f"{told}: lift {rows['lift_mm'].max():.1f} mm, "
                    f"follow {rows['follow'][-1]:.2f}, slip {rows['slip_mm'].max():.1f} mm, "
                    f"greatest force {device.peak:.2f} N",
                    flush=True,
                )
            print(f"{kept} of {seed} kept; {loop.late} of {loop.steps} samples late", flush=True)
    return seed, kept


def run(*words):
    """Runs a command. Returns its time (s)."""
    print("$", *words, flush=True)
    begun = time.monotonic()
    paths = [str(Path(teleop.__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = {"TROCAR_PYTHON": sys.executable, **os.environ}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    subprocess.run([str(word) for word in words], check=True, env=environment)
    return time.monotonic() - begun


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=10, help="that are kept")
    parser.add_argument("--steps", type=int, default=3000, help="of training")
    parser.add_argument("--tests", type=int, default=10, help="episodes of each policy")
    parser.add_argument("--program", default="trocar")
    parser.add_argument("--speed", type=float, default=1.0, help="simulated over wall time")
    parser.add_argument("--no-force", action="store_true", help="the device gets no force")
    parser.add_argument("--same-start", action="store_true", help="the arms start alike each time")
    parser.add_argument("--threads", type=int, default=0, help="of trocar view (default: all)")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="the way with two demonstrations and a test of each policy",
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("lifts"))
    options = parser.parse_args()
    if options.quick:
        # One is trained on, one is held out.
        options.episodes, options.steps, options.tests = 2, 50, 1
    out, program = options.output, options.program
    if out.exists():
        raise SystemExit(f"error: {out} exists")
    out.mkdir(parents=True)
    text = SCENE.read_text()
    text = text.replace("episode_s = 8.0", f"episode_s = {SECONDS}")
    if not options.same_start:
        text = text.replace('set = "standard"', STARTS)
    (out / "scene.toml").write_text(text)
    seed, kept = demonstrate(options)
    if kept < options.episodes:
        raise SystemExit(f"error: {kept} of {options.episodes} episodes were kept")
    for folder in sorted((out / "demonstrations").iterdir()):
        run(program, "replay", folder, "--verify")
    run(program, "export", out / "demonstrations", "-o", out / "dataset", "--size", "84x84",
        "--format", "lerobot", "--cameras", "endoscope")  # fmt: skip
    train = HERE / "train_from_pictures.py"
    spent = run(sys.executable, train, out / "dataset", "-o", out / "cloned", "--observe", "states",
                "--seeds", 0, "--steps", options.steps)  # fmt: skip
    print(f"cloned in {spent:.0f} s")
    clone = f"cloned=python:{out / 'cloned/policies.py'}:states_0"
    policies = [word for name in (clone, "scripted", "noise") for word in ("--policy", name)]
    words = ["--seed", seed, "--episodes", options.tests, "-o", out / "campaign"]
    run(program, "evaluate", out / "scene.toml", *FIXED, *policies, *words)


if __name__ == "__main__":
    main()
