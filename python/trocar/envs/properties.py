"""Properties that all environments share, whether they hold one cell or many."""

from __future__ import annotations

from typing import Any

from .cells import Cells
from .options import Options


class CellsMixin:
    """Attributes of an environment of one or many cells."""

    cells: Cells
    #: Index of this environment's (first) cell among `cells`.
    cell: int = 0
    metadata: dict[str, Any]

    def _build(self, count: int, scene: str, render_mode: str | None, options: Options) -> None:
        """Builds the cells. A wrong option is a ValueError that names it."""
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: '{render_mode}' is unknown; it must be rgb_array")
        self.render_mode = render_mode
        self.cells = Cells(count, scene, **options)
        # The class does not know the scene's rate. Videos and datasets read it from here.
        self.metadata = self.metadata | {"render_fps": self.cells.fps}

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.cells.task

    @property
    def task_description(self) -> str:
        """The task in words: the `prompt` of policies."""
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


class OneCellMixin(CellsMixin):
    """Attributes of one cell."""

    @property
    def privileged_channels(self) -> dict[str, float]:
        """Channels of the last step by name, tissue included.

        For rewards and scripts, not for policies.
        """
        return dict(zip(self.channel_names, self.cells.channels[self.cell].tolist()))

    @property
    def state_hash(self) -> int:
        """Hash over every bit that the future depends on."""
        return self.cells.native.state_hash(self.cell)


def row_of(value: Any, k: int) -> Any:
    """A copy of the observation of cell `k`. Copied because users keep observations."""
    if isinstance(value, dict):
        return {key: row_of(part, k) for key, part in value.items()}
    return value[k].copy()
