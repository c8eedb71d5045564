"""`Rope(twist=...)`: stiffness, turning of held ends, typed errors."""

import mujoco
import numpy as np
import pytest

from softgym_mj.entities.rope import Rope
from softgym_mj.exceptions import InvalidArgumentError
from tests.scenes.alone import compiled


def hanging(twist: float):
    """A rope of which both ends are held above the floor, and its physics."""
    rope = Rope("fast", twist=twist)
    physics = compiled(rope)
    points = rope.straight() + [0.0, 0.0, 0.3]
    rope.set_points(points)
    for end in rope.ends:
        rope.hold(end)
    return rope, physics


def stepped(rope: Rope, physics, steps: int, inward: float) -> None:
    """Moves the ends towards each other at a speed [m/s]."""
    for _ in range(steps):
        for end, way in zip(rope.ends, (inward, -inward), strict=True):
            rope.drive(end, rope.vertex(end) + [rope.timestep * way, 0.0, 0.0], rope.timestep)
        mujoco.mj_step(physics.model.ptr, physics.data.ptr)


def test_turned_ends_twist_the_rope_which_writhes():
    rope, physics = hanging(1e-4)
    first, last = rope.ends
    for _ in range(100):
        rope.turn_end(last, 0.3)
        rope.turn_end(first, -0.1)
        stepped(rope, physics, 1, 0.05)
    # The rope leaves the plane in which it would hang.
    assert np.ptp(rope.points()[:, 1]) > 0.02
    assert 0.0 < rope.twist_angle < 40.0
    rope.release(last)
    mujoco.mj_step(physics.model.ptr, physics.data.ptr)
    assert rope.twist_angle == 0.0


def test_a_rope_without_twist_stays_in_its_plane():
    rope, physics = hanging(0.0)
    stepped(rope, physics, 100, 0.05)
    assert np.ptp(rope.points()[:, 1]) < 1e-6
    with pytest.raises(InvalidArgumentError, match="twist"):
        rope.turn_end(0, 0.1)
    with pytest.raises(InvalidArgumentError, match="twist"):
        _ = rope.twist_angle


@pytest.mark.parametrize("twist", [-1e-6, float("nan"), 2.0])
def test_an_impossible_stiffness_is_an_error(twist):
    with pytest.raises(InvalidArgumentError, match="twist"):
        Rope(twist=twist)


def test_only_held_ends_turn():
    rope, _ = hanging(1e-5)
    with pytest.raises(InvalidArgumentError, match="index"):
        rope.turn_end(5, 0.1)
    rope.release(0)
    with pytest.raises(InvalidArgumentError, match="index"):
        rope.turn_end(0, 0.1)
    with pytest.raises(InvalidArgumentError, match="angle"):
        rope.turn_end(rope.ends[1], float("inf"))
