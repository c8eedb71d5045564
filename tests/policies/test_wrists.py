"""Experts that use the wrist: a fold by hands that lean, and cups that a wrist pours."""

import math

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts import make_policy
from softgym_mj.policies.experts.fold_cloth import TILT
from tests.robots.arms import arms_of

ALONG = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
POURS = 0.1, 1.9  # [rad] Angles of the cup between which it is poured.


def leans(env, ways):
    """Angles (2,) [rad] of hands from straight down, positive where they point along `ways`."""
    env.task.actor.positions()
    axes = env.task.actor.servos.rotations()[:, :, 2]
    along = (axes * ways).sum(axis=1) / np.linalg.norm(ways, axis=1)
    return np.arctan2(along, -axes[:, 2])


@arms_of("franka")
def test_hands_that_turn_lean_over_the_edge_that_they_fold(arm):
    env = softgym_mj.load("fold_cloth", split="evaluate", actor=arm, action="pose", fidelity="fast")
    timestep = env.reset(800)
    act, angles, progress = make_policy(env), [], []
    start, columns = env.task.cloth.points(), env.task.cloth.shape[1]
    while not timestep.last():
        timestep = env.step(act(timestep))
        held = env.task.actor.held
        if (held >= 0).all():
            mirrors = held // columns * columns + columns - 1 - held % columns
            ways = start[mirrors] - start[held]
            gone = ((env.task.cloth.points()[held] - start[held]) * ways).sum(axis=1)
            progress.append(gone / (ways**2).sum(axis=1))
            angles.append(leans(env, ways))
    angles, progress = np.array(angles), np.array(progress)
    for i in range(2):
        lean, gone = angles[:, i], progress[:, i]
        # They point inwards over where the edge lay, then inwards over where it comes to lie.
        assert lean[gone < 0.3].max() > 0.65 * TILT
        assert lean[gone > 0.7].min() < -0.4 * TILT
        assert abs(lean[np.abs(gone - 0.5).argmin()]) < 0.3 * TILT
        assert (lean[gone < 0.3] > -0.2 * TILT).all() and (lean[gone > 0.7] < 0.2 * TILT).all()
    assert env.info()["normalized_performance"] > 0.85
    assert env.info()["ik_failures"] == 0


@arms_of("franka")
def test_without_a_wrist_hands_point_down(arm):
    env = softgym_mj.load("fold_cloth", split="evaluate", actor=arm, fidelity="fast")
    timestep = env.reset(800)
    act, largest = make_policy(env), 0.0
    while not timestep.last():
        timestep = env.step(act(timestep))
        largest = max(largest, float(np.abs(leans(env, ALONG)).max()))
    assert largest < 0.2 < 0.4 * TILT  # They sway where they start and stop at once.
    with pytest.raises(InvalidArgumentError, match=r"action='position'.*'pose'"):
        env.task.actor.posing(np.zeros((2, 3)), np.zeros((2, 3)), [False, False])


@pytest.mark.parametrize("arm", ["sawyer", pytest.param("ur5e", marks=pytest.mark.slow)])
def test_a_cup_is_poured_by_the_wrist(arm):
    """Each joint's share: its axis along the cup's, times its way. Together they are the angle."""
    env = softgym_mj.load("pour_water", split="evaluate", actor=arm, fidelity="fast")
    timestep = env.reset(806)
    act, actor = make_policy(env), env.task.actor
    tool = f"arms/{arm}_0/{actor.arm.tcp_site}"
    joints, axes, tilts, aims = [], [], [], []
    while not timestep.last():
        timestep = env.step(act(timestep))
        model, data = env.physics.model.ptr, env.physics.data.ptr
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rotations = np.empty((3, model.nv))
        mujoco.mj_jacSite(model, data, None, rotations, model.site(tool).id)
        joints.append(data.qpos[actor.servos.positions_at])
        axes.append(-rotations[1, actor.servos.speeds_at])  # About -Y, along which the hand points.
        tilts.append(actor.cup.pose[2])
        aims.append(data.site(tool).xmat.reshape(3, 3)[:, 2])
    joints, axes, tilts = np.array(joints), np.array(axes), np.array(tilts)
    assert (np.array(aims) @ [0.0, -1.0, 0.0]).min() > math.cos(math.radians(5.0))
    ways = (axes[1:] + axes[:-1]) / 2 * np.diff(joints, axis=0)
    np.testing.assert_allclose(ways.sum(axis=1), -np.diff(tilts), atol=0.02)
    pours = (tilts[1:] > POURS[0]) & (tilts[1:] < POURS[1]) & (np.diff(tilts) > 0.0)
    turned = ways[pours].sum(axis=0)
    assert np.ptp(tilts) > math.radians(100.0) and -turned.sum() > 1.5
    assert turned[-1] / turned.sum() > 0.85  # The last joint alone.
    assert env.info()["normalized_performance"] > 0.9
