"""A policy for the task TASK_NAME.

    trocar episode TASK_NAME.toml --policy python:TASK_NAME.py:Policy -o TASK_NAME-python

It follows waypoints of the left arm and looks at nothing but the state that every policy sees: 47
numbers, named by `trocar_task::STATE_NAMES`. The first five are the left arm's two pivots (rad),
insertion (m), roll (rad) and jaw (0 closed to 1), as in an action; 23 to 27 are the right arm's.
Number 22 says whether the left arm holds tissue.
"""

import numpy as np

HZ = 30
ATTACHED = 22

# Pivot 1 (rad), pivot 2 (rad), insertion (m), roll (rad), jaw, and the time to get there (s).
WAYPOINTS = [
    (-0.0465, 0.3167, 0.1079, -0.4219, 1.0, 1.5),  # behind the appendix, jaws open
    (-0.0465, 0.3167, 0.1329, -0.4219, 1.0, 1.5),  # around it
    (-0.0465, 0.3167, 0.1329, -0.4219, 0.0, 1.0),  # closed
    (-0.0497, 0.3366, 0.1253, -0.4209, 0.0, 1.0),  # 8 mm up
    (-0.0497, 0.2611, 0.1225, -0.4209, 0.0, 2.0),  # 12 mm aside
]


class Policy:
    """Goes from one waypoint to the next and stays at the last."""

    def __init__(self):
        self.reset()

    def reset(self):
        """An episode begins."""
        self.at, self.done, self.start, self.right = 0, 0, None, None

    def infer(self, observation):
        """The next actions, absolute targets of both arms (steps, 10)."""
        state = np.asarray(observation["observation/state"], dtype=float)
        if self.start is None:
            self.start, self.right = state[:5], state[23:28]
        return {"actions": np.array([self.step() for _ in range(4)])}

    def step(self):
        *target, seconds = WAYPOINTS[self.at]
        self.done += 1
        share = min(1.0, self.done / (HZ * seconds))
        share = share * share * (3 - 2 * share)
        left = (1 - share) * self.start + share * np.array(target)
        if self.done >= HZ * seconds and self.at + 1 < len(WAYPOINTS):
            self.at, self.done, self.start = self.at + 1, 0, np.array(target)
        return np.concatenate([left, self.right])
