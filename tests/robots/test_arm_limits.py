"""Statements of docs/robots.md on arms that stop at once, their force limits and their reach."""

import math
import pathlib
import re

import numpy as np
import pytest

from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm.mounts import facing_each_other
from tests.robots.test_cartesian import Scene, cases, in_front

PLACE = 0.7  # [m] Distance of a base from the middle.
COMMAND = 25  # Sim steps of a command.
# Share of the motor's torque to which a force limit is widened, at steps of 10 ms.
WIDENED = 1.35, 2.7
# How far a hand goes too far after a command at a speed [m/s] has ended: least, most [mm].
BEYOND = {0.3: (6.0, 9.0), 0.6: (15.0, 25.0), 1.0: (35.0, 60.0)}


@cases
def test_force_limits_are_wider_than_torque_limits(case):
    scene = Scene.make(case)
    limits = scene.model.actuator_forcerange[scene.arms.servos.motors]
    share = limits[:, 1] / scene.arms.arm.torque_limits
    low, high = WIDENED
    assert low <= round(share.min(), 2) and share.max() <= high
    np.testing.assert_array_equal(limits[:, 0], -limits[:, 1])


@cases
def test_a_hand_goes_too_far_when_a_command_ends(case):
    scene = Scene.make(case)
    for speed, (least, most) in BEYOND.items():
        beyond = []
        for way in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
            scene.start(in_front(np.array([[0.45, 0.0, 0.3]]), PLACE))
            for _ in range(COMMAND):
                scene.step(np.array([[*(speed * np.array(way)), -1.0]]))
            goal = scene.arms.commanded_positions()[0]
            for _ in range(COMMAND):
                scene.step(np.array([[0.0, 0.0, 0.0, -1.0]]))
                beyond.append(1000.0 * (scene.arms.positions()[0] - goal) @ way)
        assert least < max(beyond) < most
        for _ in range(3 * COMMAND):
            scene.step(np.array([[0.0, 0.0, 0.0, -1.0]]))
        assert np.linalg.norm(scene.arms.positions()[0] - goal) < 0.001


def test_the_page_has_the_reach_of_each_arm():
    """Points straight ahead, and 0.4 m ahead of the base as far aside as possible."""
    page = pathlib.Path(__file__).parents[2].joinpath("docs", "robots.md").read_text("utf-8")
    page = page.replace("\u2212", "-")  # Minus signs.
    rows = re.findall(r"^\| (?:on the floor |0\.5 m high )?((?:\| [-\d.]+ ){7})\|$", page, re.M)
    assert len(rows) == 9
    for row, base in zip(rows, [0.0] * 4 + [0.5] * 5, strict=True):
        height, *reach = map(float, row.split("|")[1:])
        for arm, ahead, aside in zip(ARMS.values(), reach[::2], reach[1::2], strict=True):
            (mount,) = facing_each_other(1, arm.distance, *arm.reach, height=base)
            farthest = mount.clip(np.array([0.0, 9.0, height]))
            assert farthest[1] == pytest.approx(ahead, abs=0.0051)
            radius = farthest[1] + arm.distance
            corner = np.array([math.sqrt(radius**2 - 0.4**2), 0.4 - arm.distance, height])
            assert corner[0] == pytest.approx(aside, abs=0.0051)
            np.testing.assert_allclose(mount.clip(corner), corner, atol=1e-12)
            assert mount.clip(corner + [1e-3, 0.0, 0.0])[0] < corner[0] + 1e-3
