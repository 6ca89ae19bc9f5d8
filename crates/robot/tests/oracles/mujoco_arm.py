"""What MuJoCo says of an arm. Run by ../chain_mujoco.rs:

    python mujoco_arm.py MODEL TIP FLANGE states FILE      a line "q qd" a state -> a line a state: positions and matrices of the
                                                           bodies up to TIP, position of the site FLANGE, its Jacobian, mass matrix, bias, gravity
    python mujoco_arm.py MODEL TIP FLANGE trajectory FILE STEP FRICTION EVERY
                                                           first line "q qd", then torques a step -> a line "q qd" each EVERY steps

FRICTION is "hard" (MuJoCo's constraint as stiff as the step allows) or "none".
"""

import sys

import mujoco
import numpy as np


def line(*arrays):
    print(" ".join(repr(float(x)) for a in arrays for x in np.asarray(a).ravel()))


def main():
    path, tip, flange, mode, table = sys.argv[1:6]
    model = mujoco.MjModel.from_xml_path(path)
    # The arm alone: no servos, no contacts.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION | mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    n = model.nv
    rows = np.loadtxt(table, ndmin=2) if mode == "states" else None
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, flange)
    bodies = [model.jnt_bodyid[j] for j in range(model.njnt)]
    if mode == "states":
        for row in rows:
            data.qpos[:], data.qvel[:] = row[:n], row[n:]
            mujoco.mj_forward(model, data)
            linear, angular = np.zeros((3, n)), np.zeros((3, n))
            mujoco.mj_jacSite(model, data, linear, angular, site)
            mass = np.zeros((n, n))
            try:
                mujoco.mj_fullM(model, mass, data.qM)
            except (AttributeError, TypeError):
                mujoco.mj_fullM(model, data, mass)
            bias = data.qfrc_bias.copy()
            data.qvel[:] = 0
            mujoco.mj_forward(model, data)
            line(data.xpos[bodies], data.xmat[bodies], data.site_xpos[site], linear, angular, mass, bias, data.qfrc_bias)
        return
    step, friction, every = float(sys.argv[6]), sys.argv[7], int(sys.argv[8])
    lines = open(table).read().splitlines()
    state = np.array(lines[0].split(), float)
    # Euler with implicit damping, which is semi-implicit as ours is.
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.timestep = step
    model.opt.tolerance = 1e-14
    model.opt.iterations = 200
    if friction == "none":
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    if friction == "hard":
        model.dof_solref[:] = [2 * step, 1]
        model.dof_solimp[:] = [0.9999, 0.9999, 0.001, 0.5, 2]
    data.qpos[:], data.qvel[:] = state[:n], state[n:]
    for k, text in enumerate(lines[1:]):
        data.qfrc_applied[:] = np.array(text.split(), float)
        mujoco.mj_step(model, data)
        if (k + 1) % every == 0:
            line(data.qpos, data.qvel)


main()
