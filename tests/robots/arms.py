"""Helpers for tests of arms: the default subset of many cases, and torques."""

import pytest

from softgym_mj.robots.arm.models import ARMS


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


def motor_torques(model, data, servos):
    """Returns the motors' torques (n,) [N m] after the step, as the servos are implicit."""
    kp, kv = model.actuator_gainprm[servos.motors, 0], -model.actuator_biasprm[servos.motors, 2]
    gap = data.ctrl[servos.motors] - data.qpos[servos.positions_at]
    return kp * gap - kv * data.qvel[servos.speeds_at]
