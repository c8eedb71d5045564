"""Trajectories of the rags against what is published of them."""

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import primitives

STEP = 1e-3  # [s]


def motion(primitive):
    """Times, positions in Y and Z, speeds and accelerations, by differences."""
    times = np.arange(0.0, primitives.duration(primitive) + STEP / 2, STEP)
    places = primitives.gripper_positions(primitive, times)[:, 0, 1:]
    velocities = np.diff(places, axis=0) / STEP
    accelerations = np.diff(places, n=2, axis=0) / STEP**2
    return times, places, velocities, accelerations


# Time [s], Y, Z [m], velocity of Y [m/s], acceleration of Y [m/s^2], where pieces of it meet.
JOINTS = {
    "dynamic": [
        (0.0, 0.0, 1.0, 0.0, 0.0),
        (1.1, -0.25, 1.06, -0.7, 3.0),
        (2.6, 0.30, 1.06, 0.0, -1.0),
        (3.9, 0.15, 0.48949, -0.3, -0.5),
        (4.4, -0.10, 0.48949, 0.0, 0.0),
    ],
    "quasi_static": [
        (0.0, 0.0, 1.0, 0.0, 0.0),
        (1.0, 0.0, 0.95, 0.0, 0.0),
        (2.0, 0.0, 0.95, 0.0, 0.0),
        (14.0, -0.60, 0.68949, 0.0, 0.0),
    ],
}


@pytest.mark.parametrize("primitive", JOINTS)
def test_pieces_meet_as_published(primitive):
    h = 1e-4
    for time, y, z, velocity, acceleration in JOINTS[primitive]:
        around = np.array([time - h, time, time + h])
        places = primitives.gripper_positions(primitive, around)
        assert places[1, 0] == pytest.approx([0.020, y, z], abs=1e-9)
        assert places[1, 1] == pytest.approx([0.498, y, z], abs=1e-9)
        before, here, after = places[:, 0, 1]
        assert (after - before) / (2 * h) == pytest.approx(velocity, abs=1e-3)
        assert (after - 2 * here + before) / h**2 == pytest.approx(acceleration, abs=0.05)


def test_the_fling_is_as_fast_as_published():
    assert primitives.duration("dynamic") == pytest.approx(4.4)
    _, _, velocities, accelerations = motion("dynamic")
    assert np.linalg.norm(velocities, axis=1).max() == pytest.approx(0.85, abs=0.005)
    assert np.quantile(np.linalg.norm(accelerations, axis=1), 0.99) == pytest.approx(4.5, abs=0.1)
    assert np.linalg.norm(accelerations, axis=1).max() < 6.0  # As a function it has no jump.


def test_the_drag_is_as_slow_as_published():
    assert primitives.duration("quasi_static") == pytest.approx(14.0)
    _, places, velocities, _ = motion("quasi_static")
    assert np.linalg.norm(velocities, axis=1).max() == pytest.approx(0.10, abs=0.005)
    assert (np.diff(places[:, 1]) <= 1e-6).all()


def test_grippers_stand_still_before_and_after():
    places = primitives.gripper_positions("dynamic", np.array([-1.0, 0.0, 4.4, 9.0]))
    np.testing.assert_array_equal(places[0], places[1])
    np.testing.assert_array_equal(places[2], places[3])


@pytest.mark.parametrize(
    "call",
    [
        lambda: primitives.gripper_positions("fling", np.zeros(3)),
        lambda: primitives.gripper_positions("dynamic", np.array([np.nan])),
        lambda: primitives.gripper_positions("dynamic", np.zeros((2, 2))),
        lambda: primitives.duration("fling"),
    ],
)
def test_what_makes_no_sense_is_refused(call):
    with pytest.raises(InvalidArgumentError, match=r"primitive|times"):
        call()
