"""Gymnasium environments of the two-arm cell.

| name | task | passes when |
|---|---|---|
| `trocar/AppendixResection-v0` | `appendix-resection` | grasp, lift, positioning, jaw on tissue and cut are done, in this order |
| `trocar/GraspLift-v0` | `grasp-lift` | the appendix is grasped, lifted and held |
| `trocar/PortReach-v0` | `port-reach` | both instruments have been at three places each, in free motion |

`TrocarEnv` is one cell, `TrocarVectorEnv` many in one process, which is what `gymnasium.make_vec` makes. Both take

- `scene`: a built-in scene or a scene file (`cell-a`).
- `obs`: what is observed, joined by `+`: `state`, `rgb`, `depth`. `state` alone gives one array, otherwise a dict gives
  `agent_pos` (the state), `pixels` (per camera height x width x 3, 8 bits) and `depth` (per camera height x width x 1, z [m], 0
  where nothing is). `agent_pos` is the state in a dict even where it is alone, as LeRobot wants it.
- `cameras`: which are seen; all of the scene's but the recording one if not given. `image_size`: height and width [px], the scene's
  `policy_size_px` if not given. `sensor_noise`: colours and measured depth have the noise of their sensors, by the episode's seed.
- `render_mode="rgb_array"`: `render()` gives the endoscope's picture.
- `actions`: `pivots` for absolute targets (two pivots [rad], insertion [m], roll [rad], jaw opening 0 to 1, for each arm), `tip` for
  steps of the tip ([m], roll [rad], jaw opening). With `normalize=True` every number is -1 to 1.
- `episode_s`: longest episode [s], the scene's if not given.
- `threads`: 0 for as many as the machine has, at most 1024. Results do not depend on it.

`gym.make` gives a `TrocarEnv` without wrappers. Seeds are 0 to 2^63 - 1. An environment belongs to the process that made it: a child
made by `fork` is refused with a RuntimeError and makes its own.

The reward is the gain in stages, parts of stages included: an episode that passes gives as much as its task has stages. What is
privileged (tissue, channels) is in `info` alone, and only with `privileged=True`.
"""

from .single import TrocarEnv
from .vector import TrocarVectorEnv

__all__ = ["TrocarEnv", "TrocarVectorEnv"]
