"""Gymnasium environments of the two-arm cell.

| id | task | passed when |
|---|---|---|
| `trocar/AppendixResection-v0` | `appendix-resection` | the five stages are done in order |
| `trocar/GraspLift-v0` | `grasp-lift` | the appendix is grasped, lifted and held |
| `trocar/PortReach-v0` | `port-reach` | both tips have reached three places each, free of tissue |

The stages of `appendix-resection` are grasp, lift, positioning, jaw on tissue and cut.

`TrocarEnv` is one cell. `TrocarVectorEnv` is many cells in one process; `gymnasium.make_vec` makes
one. Both take these options:

- `scene`: a built-in scene or a scene file (default `cell-a`).
- `obs`: the observations, joined by `+`: `state`, `rgb`, `depth`. `state` alone is one float32
  array. Otherwise the observation is a dict of `agent_pos` (the state), `pixels` (one
  (height, width, 3) uint8 array a camera) and `depth` (one (height, width, 1) float32 array a
  camera: z (m), 0 where nothing is seen). `agent_pos` is the state in a dict even when it is alone,
  as LeRobot expects.
- `cameras`: the observed cameras (default: all of the scene except `recording`).
- `image_size`: height and width (px) of pictures (default: the scene's `policy_size_px`).
- `sensor_noise`: adds the sensors' noise to colours and depth, seeded by the episode's seed.
- `render_mode="rgb_array"`: `render()` returns the endoscope's picture.
- `actions`: `pivots` for absolute targets, five numbers an arm: two pivot angles (rad), insertion
  (m), roll (rad), jaw opening in [0, 1]. `tip` for increments of the tip (m), of the roll (rad) and
  of the jaw opening.
- `normalize`: every number of an action is in [-1, 1].
- `episode_s`: maximum duration of an episode (s) (default: the scene's).
- `threads`: 0 for one a core, at most 1024. Results do not depend on it.
- `privileged`: `info["channels"]` holds the privileged channels.
- `variation`: what the seed of an episode draws: `none`, `easy`, `standard` or `hard` (default: the
  set of the scene, or `standard` if it has none). The anatomies of a set are made once, about a
  minute each; `none` is the fixed cell of the scene.
- `split`: `seen` (default) for episodes to train on, `unseen` for episodes that are kept apart,
  with anatomies of their own, or `both`. The seed of an episode decides its split: unseen ones
  have seeds from 1,000,000 on. A seed of another split is a ValueError.
- `backend`: the model of the tissue, `tetrahedra` (`tets`) or `lattice` (default: the scene's).

`gym.make` returns a `TrocarEnv` without wrappers. Seeds are at most 2^63 - 1. An environment
belongs to the process that made it: a child made by `fork` gets a RuntimeError and must make its
own.

The reward is the increase of the task's score, partial stages included: a passed episode returns
the number of stages of its task. Privileged information (tissue, channels) is only in `info`, and
only with `privileged=True`.
"""

from .single import TrocarEnv
from .vector import TrocarVectorEnv

__all__ = ["TrocarEnv", "TrocarVectorEnv"]
