"""Behaviour cloning on GraspLift from endoscope pictures, where every episode varies.

    pip install '.[datasets,policies]' torch matplotlib
    python examples/python/record_demonstrations.py --episodes 300 --keep 200 --seconds 9 \
        --size 84 --noise 0.5 --scene examples/python/lift_from_pictures.toml \
        --variation standard -o lifts
    python examples/python/train_from_pictures.py lifts -o cloned
    python examples/python/train_from_pictures.py lifts -o cloned --observe states
    trocar evaluate examples/python/lift_from_pictures.toml --split unseen --episodes 20 \
        --policy pictures_0=python:cloned/policies.py:pictures_0

The policy observes one endoscope picture of 84 x 84 pixels and what a robot measures of its left
arm: coordinates, rates, tip, force, whether the jaws hold tissue, and how far the tip has risen
since they do. It does not get the stage. With `--observe states` it does not get the picture
either: the same network, blind. It predicts the targets of the left arm for the next 0.8 s, of
which the first 4 are executed before it is asked again. The right arm stays where it starts.

Of the demonstrations, the last tenth is held out for the curve. Nothing is pretrained.
"""

import argparse
import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

#: The observed numbers of a state: coordinates, rates and tip of the left arm, its force, and
#: whether its jaws hold tissue.
OBSERVED = [*range(13), 18, 19, 20, 22]
#: Where a state says whether the left jaws hold tissue, and the height of the left tip (m).
HOLDS, HEIGHT = 22, 12
#: How many numbers the network gets besides the picture: those observed, and the rise.
NUMBERS = len(OBSERVED) + 1
#: Targets of the left arm in an action, and the arms' coordinates in a state.
LEFT, RIGHT = slice(0, 5), slice(23, 28)
#: Predicted steps of 1/30 s, and how many of them are executed.
HORIZON, EXECUTED = 24, 4
#: Pictures are shifted by up to this in training (px), as by other poses of the camera.
SHIFT = 4
#: Share of the episodes that are held out.
HELD_OUT = 0.1
#: Rows of the curve.
ROWS = 25


class Net(nn.Module):
    """Targets (n, HORIZON, 5) from pictures (n, 3, height, width) and numbers (n, NUMBERS).

    The pictures become places: the mean position of each of 48 feature maps (Levine et al. 2016).
    The first four targets are differences to the present coordinates; the jaw is absolute. All are
    in units of their standard deviation in the demonstrations.
    """

    def __init__(self, observe: str):
        super().__init__()
        self.observe, places = observe, 0
        if observe == "pictures":
            places = 48
            self.convolutions = nn.Sequential(
                nn.Conv2d(3, 24, 5, stride=2, padding=2),
                nn.ReLU(),
                nn.Conv2d(24, 32, 3, stride=2, padding=1),
                nn.ReLU(),
                nn.Conv2d(32, places, 3, padding=1),
            )
        self.head = nn.Sequential(
            nn.Linear(2 * places + NUMBERS, 256),
            nn.ReLU(),
            nn.Linear(256, 256),
            nn.ReLU(),
            nn.Linear(256, 5 * HORIZON),
        )
        for name, count in [("mean", NUMBERS), ("deviation", NUMBERS), ("scale", 5)]:
            self.register_buffer(name, torch.ones(count))

    def forward(self, pictures: torch.Tensor | None, numbers: torch.Tensor) -> torch.Tensor:
        seen = (numbers - self.mean) / self.deviation
        if pictures is not None:
            maps = self.convolutions(pictures.float() / 127.5 - 1.0)
            weights = maps.flatten(2).softmax(-1).view_as(maps)
            rows = torch.linspace(-1.0, 1.0, maps.shape[2])
            columns = torch.linspace(-1.0, 1.0, maps.shape[3])
            places = [(weights.sum(3) * rows).sum(-1), (weights.sum(2) * columns).sum(-1)]
            seen = torch.cat([*places, seen], -1)
        return self.head(seen).view(-1, HORIZON, 5)


class Rise:
    """How far the left tip has risen since its jaws hold tissue (m), 0 while they do not."""

    def __init__(self) -> None:
        self.held_from: float | None = None

    def numbers(self, state: np.ndarray) -> np.ndarray:
        """What the network gets of a state, one after the other of an episode."""
        if not state[HOLDS]:
            self.held_from = None
        elif self.held_from is None:
            self.held_from = float(state[HEIGHT])
        rise = 0.0 if self.held_from is None else state[HEIGHT] - self.held_from
        return np.append(state[OBSERVED], np.float32(rise))


class Demonstrations:
    """The frames of a LeRobot dataset of `record_demonstrations.py`, in memory."""

    def __init__(self, folder: Path, observe: str, episodes: int | None = None):
        import av
        import pandas as pd

        info = json.loads((folder / "meta/info.json").read_text())
        parts = sorted((folder / "data").rglob("*.parquet"))
        table = pd.concat([pd.read_parquet(part) for part in parts])
        table = table[table["episode_index"] < (episodes or info["total_episodes"])]
        state = np.stack(table["observation.state"].to_numpy()).astype(np.float32)
        action = np.stack(table["action"].to_numpy()).astype(np.float32)
        episode = table["episode_index"].to_numpy()
        rises = [Rise() for _ in range(episode[-1] + 1)]
        numbers = [rises[k].numbers(one) for k, one in zip(episode, state)]
        self.numbers = torch.from_numpy(np.stack(numbers))
        # What comes after the end of an episode does not count.
        last = np.searchsorted(episode, episode, side="right") - 1
        ahead = np.arange(len(table))[:, None] + np.arange(HORIZON)
        self.counts = torch.from_numpy(ahead <= last[:, None])
        targets = action[np.minimum(ahead, last[:, None])][..., LEFT]
        targets[..., :4] -= state[:, None, :4]
        self.targets = torch.from_numpy(targets)
        count = int(episode[-1]) + 1
        split = count - max(1, round(HELD_OUT * count))
        self.train = np.flatnonzero(episode < split)
        self.held_out = np.flatnonzero(episode >= split)
        self.episodes = count
        self.pictures = None
        if observe == "pictures":
            frames = []
            videos = folder / "videos/observation.images.endoscope"
            for path in sorted(videos.rglob("*.mp4"))[:count]:
                with av.open(str(path)) as video:
                    frames += [f.to_ndarray(format="rgb24") for f in video.decode(video=0)]
            if len(frames) != len(table):
                raise SystemExit(f"{folder}: {len(frames)} pictures, {len(table)} rows")
            self.pictures = torch.from_numpy(np.stack(frames)).permute(0, 3, 1, 2)

    def batch(
        self, rows: np.ndarray, dice: np.random.Generator | None
    ) -> tuple[torch.Tensor | None, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Pictures, numbers and targets of `rows`, and which targets count.

        With `dice` each picture is shifted.
        """
        pictures = None if self.pictures is None else self.pictures[rows]
        if pictures is not None and dice is not None:
            height, width = pictures.shape[2:]
            wide = nn.functional.pad(pictures.float(), (SHIFT,) * 4, mode="replicate")
            corners = dice.integers(2 * SHIFT + 1, size=(len(rows), 2)).tolist()
            pictures = torch.stack(
                [
                    one[:, down : down + height, right : right + width]
                    for one, (down, right) in zip(wide, corners)
                ]
            )
        return pictures, self.numbers[rows], self.targets[rows], self.counts[rows]


def loss_of(
    net: Net,
    pictures: torch.Tensor | None,
    numbers: torch.Tensor,
    targets: torch.Tensor,
    counts: torch.Tensor,
) -> torch.Tensor:
    """The mean absolute error in units of the targets' deviations."""
    return (net(pictures, numbers) - targets / net.scale)[counts].abs().mean()


def train(
    data: Demonstrations, observe: str, seed: int, steps: int, batch: int
) -> tuple[Net, list[tuple[float, ...]]]:
    """A trained network and its curve: step, seconds, loss in training and on held-out episodes."""
    torch.manual_seed(seed)
    dice = np.random.default_rng(seed)
    net = Net(observe)
    net.mean.copy_(data.numbers[data.train].mean(0))
    net.deviation.copy_(data.numbers[data.train].std(0) + 1e-6)
    net.scale.copy_(data.targets[data.train].flatten(0, 1).std(0) + 1e-6)
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 1e-3, total_steps=steps)
    judged = data.held_out[:: max(1, len(data.held_out) // 512)]
    rows: list[tuple[float, ...]] = []
    recent, begun = [], time.perf_counter()
    for step in range(1, steps + 1):
        loss = loss_of(net, *data.batch(dice.choice(data.train, batch), dice))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        recent.append(loss.item())
        if step % max(1, steps // ROWS) == 0 or step == steps:
            with torch.no_grad():
                held_out = loss_of(net, *data.batch(judged, None)).item()
            seconds = time.perf_counter() - begun
            rows.append((step, seconds, float(np.mean(recent)), held_out))
            print(
                f"{observe} {seed}: step {step}, {seconds:.0f} s, loss {rows[-1][2]:.3f}, "
                f"held out {held_out:.3f}",
                flush=True,
            )
            recent = []
    return net, rows


class Cloned:
    """A trained policy for `trocar evaluate` and `python -m trocar.serve`."""

    def __init__(self, weights: str | Path):
        torch.set_num_threads(1)
        saved = torch.load(weights, weights_only=True)
        self.net = Net(saved["observe"])
        self.net.load_state_dict(saved["net"])
        self.reset()

    def reset(self) -> None:
        """Starts an episode."""
        self.right: np.ndarray | None = None
        self.rise = Rise()

    def infer(self, obs: dict[str, Any]) -> dict[str, Any]:
        """A chunk (4, 10) of absolute targets."""
        state = np.asarray(obs["observation/state"], np.float32)
        if self.right is None:
            self.right = state[RIGHT].copy()
        picture = None
        if self.net.observe == "pictures":
            seen = np.array(obs["observation/images/endoscope"])
            picture = torch.from_numpy(seen).permute(2, 0, 1)[None]
        with torch.no_grad():
            numbers = torch.from_numpy(self.rise.numbers(state))[None]
            targets = self.net(picture, numbers)[0] * self.net.scale
        chunk = np.tile(np.concatenate([np.zeros(5), self.right]), (EXECUTED, 1))
        chunk[:, LEFT] = targets[:EXECUTED].numpy()
        chunk[:, :4] += state[:4]
        return {"actions": chunk}


def draw(folder: Path) -> None:
    """Draws the curves of all policies in a folder."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.6))
    colors: dict[str, str] = {}
    for path in sorted(folder.glob("*.csv")):
        kind = re.sub(r"_\d+$", "", path.stem)
        rows = np.loadtxt(path, delimiter=",", ndmin=2)
        colors.setdefault(kind, f"C{len(colors)}")
        first = path.stem.endswith("_0")
        for column, style, name in [(2, ":", "training"), (3, "-", "held out")]:
            label = f"{kind.replace('_', ' ')}, {name}" if first else None
            axes.plot(rows[:, 0], rows[:, column], style, color=colors[kind], label=label)
    axes.set_xlabel("step")
    axes.set_ylabel("mean absolute error (deviations)")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize="small")
    figure.tight_layout()
    figure.savefig(folder / "curve.png", dpi=90)
    plt.close(figure)


def write_policies(folder: Path) -> None:
    """Writes `policies.py`, which has a function for each trained policy in a folder."""
    here = Path(__file__).resolve()
    lines = [
        '"""Trained policies, for `trocar evaluate --policy NAME=python:FILE:NAME`."""',
        "",
        "import sys",
        "from pathlib import Path",
        "",
        f"sys.path.insert(0, {str(here.parent)!r})",
        f"from {here.stem} import Cloned",
    ]
    for path in sorted(folder.glob("*.pt")):
        lines += [
            "",
            "",
            f"def {path.stem}():",
            f"    return Cloned(Path(__file__).with_name({path.name!r}))",
        ]
    (folder / "policies.py").write_text("\n".join(lines) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path, help="a dataset of record_demonstrations.py")
    parser.add_argument("--observe", default="pictures", choices=["pictures", "states"])
    parser.add_argument("--name", help="of the policies (default: what they observe)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--steps", type=int, default=700)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--episodes", type=int, help="use this many (default: all)")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("cloned"))
    options = parser.parse_args()
    name = options.name or options.observe
    if not name.isidentifier():
        parser.error(f"--name {name}: it must be a Python name")
    torch.set_num_threads(options.threads)
    options.output.mkdir(parents=True, exist_ok=True)
    data = Demonstrations(options.dataset, options.observe, options.episodes)
    print(f"{data.episodes} episodes, {len(data.numbers)} frames", flush=True)
    for seed in options.seeds:
        net, rows = train(data, options.observe, seed, options.steps, options.batch)
        path = options.output / f"{name}_{seed}.pt"
        torch.save({"observe": options.observe, "net": net.state_dict()}, path)
        header = "step,seconds,training loss,held-out loss"
        np.savetxt(path.with_suffix(".csv"), rows, "%.5g", ",", header=header)
    write_policies(options.output)
    draw(options.output)
    print(f"written: {options.output}")


if __name__ == "__main__":
    main()
