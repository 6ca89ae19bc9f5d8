"""What environments say of their cells, whether they are one or many."""

from __future__ import annotations

from typing import Any

from .cells import Cells
from .options import Options


class OfCells:
    """What is asked of an environment by name."""

    cells: Cells
    #: Number of its cell among `cells`, the first where it has many.
    cell: int = 0

    def _begin(self, count: int, scene: str, render_mode: str | None, options: Options) -> None:
        """Builds the cells; what is wrong with an option is told by its name."""
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: '{render_mode}' is unknown; rgb_array is known")
        self.render_mode = render_mode
        self.cells = Cells(count, scene, **options)
        # The class knows no scene; films and datasets take the rate from here.
        self.metadata: dict[str, Any] = type(self).metadata | {"render_fps": self.cells.fps}

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.cells.task

    @property
    def task_description(self) -> str:
        """What is asked for, in words: the `prompt` of policies."""
        return self.cells.prompt

    @property
    def state_names(self) -> list[str]:
        """Names of the numbers of a state."""
        return self.cells.state_names

    @property
    def action_names(self) -> list[str]:
        """Names of the numbers of an action."""
        return self.cells.action_names

    @property
    def channel_names(self) -> list[str]:
        """Names of the privileged channels."""
        return self.cells.channel_names

    @property
    def _max_episode_steps(self) -> int:
        return self.cells.max_steps


class OfOneCell(OfCells):
    """What is asked of one cell."""

    @property
    def privileged_channels(self) -> dict[str, float]:
        """Channels of the last step by name: tissue and all, for rewards of one's own and for scripts, not for policies."""
        return dict(zip(self.channel_names, self.cells.channels[self.cell].tolist()))

    @property
    def state_hash(self) -> int:
        """Hash over every bit that the future depends on."""
        return self.cells.native.state_hash(self.cell)


def row_of(value: Any, k: int) -> Any:
    """What cell `k` sees, as a copy: users keep observations."""
    return (
        {key: row_of(part, k) for key, part in value.items()}
        if isinstance(value, dict)
        else value[k].copy()
    )
