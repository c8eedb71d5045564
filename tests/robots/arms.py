"""What tests of arms share: which of many cases are usual, motions, torques."""

import numpy as np
import pytest

from softgym_mj.robots.models import ARMS

ENV_STEP = 0.08  # [s] Of tasks with cloth and rope.


def cases_of(tasks, *usual):
    """Parametrizes `case` with "task/arm"; what is not usual is slow."""
    return usually("case", [f"{task}/{arm}" for task in tasks for arm in ARMS], *usual)


def arms_of(*usual):
    """Parametrizes `arm`; what is not usual is slow."""
    return usually("arm", ARMS, *usual)


def usually(name, values, *usual):
    """Parametrizes with `values`; those that are not `usual` are slow."""
    marks = {value: () if value in usual else pytest.mark.slow for value in values}
    return pytest.mark.parametrize(name, [pytest.param(v, marks=marks[v]) for v in marks])


def go(env, goals, closed, speed=0.6, steps=60):
    """Moves the commanded points to `goals` (n, 3) [m], at up to `speed` [m/s] along each axis."""
    actor = env.task.actor
    for _ in range(steps):
        way = (goals - actor.commanded_positions()) / ENV_STEP
        way *= speed / max(np.abs(way).max(), speed)
        env.step(np.column_stack([way, np.full(len(way), 1.0 if closed else -1.0)]).ravel())
        if np.abs(actor.positions() - goals).max() < 0.002:
            return


def wait(env, closed, steps):
    """Stands still for env steps."""
    for _ in range(steps):
        env.step(np.tile([0.0, 0.0, 0.0, 1.0 if closed else -1.0], env.task.actor.num_grippers))


def motor_torques(model, data, servos):
    """What the motors deliver (n,) [N m]: after the step, as the servos are implicit."""
    kp, kv = model.actuator_gainprm[servos.motors, 0], -model.actuator_biasprm[servos.motors, 2]
    gap = data.ctrl[servos.motors] - data.qpos[servos.positions_at]
    return kp * gap - kv * data.qvel[servos.speeds_at]
