"""Friction of a cloth on the floor: where it holds still, and how far it slides."""

import mujoco
import numpy as np
import pytest

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth

GRAVITY = 9.81


def lying(mode):
    """A flat cloth with the nominal friction of 1, its model and data."""
    cloth, arena = Cloth(dims=(60, 60), self_contact=mode), Arena(camera="cloth")
    arena.attach(cloth)
    physics = arena.compile(cloth.timestep, cloth)
    cloth.set_vertices(cloth.flat())
    mujoco.mj_step(physics.model.ptr, physics.data.ptr, 100)
    return cloth, physics


@pytest.mark.parametrize("mode", ["plugin", "mujoco"])
@pytest.mark.parametrize(("tangent", "holds"), [(0.95, True), (1.15, False)])
def test_a_cloth_holds_still_up_to_the_coefficient(mode, tangent, holds):
    cloth, physics = lying(mode)
    angle, start = np.arctan(tangent), cloth.vertices()
    gravity = [GRAVITY * np.sin(angle), 0.0, -GRAVITY * np.cos(angle)]
    physics.model.ptr.opt.gravity[:] = gravity
    mujoco.mj_step(physics.model.ptr, physics.data.ptr, 200)
    way = (cloth.vertices() - start)[:, 0].mean()
    # MuJoCo's soft contact creeps by 0.4 mm/s.
    assert way < 0.002 if holds else way > 0.02


@pytest.mark.parametrize("mode", ["none", "mujoco"])
@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_without_the_plugin_a_cloth_slides_as_far_as_coulomb_says(mode, speed):
    cloth, physics = lying(mode)
    start = cloth.vertices()
    physics.data.ptr.qvel[0::3] += speed
    mujoco.mj_step(physics.model.ptr, physics.data.ptr, 100)
    way = (cloth.vertices() - start)[:, 0].mean()
    assert way == pytest.approx(speed**2 / (2 * GRAVITY), rel=0.12)
