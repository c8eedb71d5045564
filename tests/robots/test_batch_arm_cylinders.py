"""Contact points of boxes on caps of cylinders, against closed forms and MuJoCo."""

import math

import jax
import mujoco
import numpy as np
import pytest

from softgym_mj.robots.arm_batch import cylinders
from tests.robots.test_batch_arm_boxes import found_by_mujoco

PAD = np.array([0.00875, 0.004, 0.00925])  # Half sizes of a Franka's pad [m].
PEG = 0.008, 0.0125  # Radius and half the height of a peg of route_cable [m].
DEEP = 0.0005  # Overlap [m].
ABOVE = PEG[1] + PAD[2] - DEEP  # Height of a flat pad's center [m].
PAIRS = 600


def _found(pads, turns, pegs, frames, radius):
    """Points, normals and distances of pads at poses (n, 3), (n, 3, 3) on pegs."""
    pad, peg = (np.tile(size, (len(pads), 1)) for size in (PAD, (radius, radius, PEG[1])))
    with jax.enable_x64(True):
        found = jax.jit(jax.vmap(cylinders.box_cap))((pads, turns, pad), (pegs, frames, peg))
    return [np.asarray(array) for array in found]


def _matrix(quaternion):
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion) / np.linalg.norm(quaternion))
    return matrix.reshape(3, 3)


# Radius [m], center of the pad relative to the peg's axis [m], and points of its face.
FLAT = {
    "across": (0.008, (0.0, 0.0), [(x * math.sqrt(0.008**2 - 0.004**2), y * 0.004)
                                   for x in (-1, 1) for y in (-1, 1)]),
    "over": (0.003, (0.001, 0.0005), [(x * 0.003 / math.sqrt(2.0), y * 0.003 / math.sqrt(2.0))
                                      for x in (-1, 1) for y in (-1, 1)]),
    "inside": (0.03, (0.01, 0.002), [(0.01 + x * PAD[0], 0.002 + y * PAD[1])
                                     for x in (-1, 1) for y in (-1, 1)]),
    "corner": (0.008, (0.012, 0.01), [(0.00325, 0.006), (math.sqrt(0.008**2 - 0.006**2), 0.006),
                                      (0.00325, math.sqrt(0.008**2 - 0.00325**2))]),
}  # fmt: skip


@pytest.mark.parametrize("case", FLAT)
def test_a_flat_pad_touches_where_its_face_and_the_cap_overlap(case):
    radius, middle, flat = FLAT[case]
    expected = np.array([(*point, PEG[1] - DEEP / 2) for point in flat])
    pads = np.array([[*middle, ABOVE], [*middle, -ABOVE]])  # On the upper cap and on the lower.
    frame, away = _matrix([0.5, 0.3, -0.7, 0.2]), np.array([0.4, 0.1, 0.2])
    points, normals, distances = _found(
        away + pads @ frame.T, np.array([frame] * 2), np.array([away] * 2),
        np.array([frame] * 2), radius,
    )  # fmt: skip
    for i, side in enumerate((1.0, -1.0)):
        touches = np.isfinite(distances[i])
        np.testing.assert_allclose(distances[i][touches], -DEEP, atol=1e-12)
        np.testing.assert_allclose(normals[i], np.tile(-side * frame[:, 2], (4, 1)), atol=1e-12)
        found = (points[i][touches] - away) @ frame * [1.0, 1.0, side]
        assert len(found) == len(expected)
        gaps = np.linalg.norm(found[:, None] - expected, axis=-1)
        assert max(gaps.min(0).max(), gaps.min(1).max()) < 1e-12


@pytest.mark.parametrize(("angle", "number"), [(0.03, 4), (0.08, 2), (0.1, 0)])
def test_corners_of_a_tilted_pad_are_below_the_cap(angle, number):
    turn = _matrix([math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0])
    points, normals, distances = _found(
        np.array([[0.0, 0.0, ABOVE]]), turn[None], np.zeros((1, 3)), np.eye(3)[None], 0.03
    )
    touches = np.isfinite(distances[0])
    assert touches.sum() == number
    corners = np.array([(x, y, -1.0) for x in (-1, 1) for y in (-1, 1)]) * PAD
    heights = [ABOVE - x * math.sin(angle) + z * math.cos(angle) - PEG[1] for x, _, z in corners]
    expected = sorted(height * math.cos(angle) for height in heights if height < 0.0)[:number]
    np.testing.assert_allclose(sorted(distances[0][touches]), expected, atol=1e-12)
    down = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    np.testing.assert_allclose(normals[0], np.tile(down, (4, 1)), atol=1e-12)
    for point, distance in zip(points[0][touches], distances[0][touches], strict=True):
        on_cap = point + 0.5 * distance * down
        assert on_cap[2] == pytest.approx(PEG[1], abs=1e-12)
        corner = (on_cap + [0.0, 0.0, distance / math.cos(angle) - ABOVE]) @ turn
        assert np.linalg.norm(corners - corner, axis=1).min() < 1e-12


@pytest.mark.parametrize("radius", [0.003, 0.008, 0.03])
def test_tilted_pads_touch_caps_as_in_mujoco(radius):
    random, poses = np.random.default_rng(0), np.zeros((PAIRS, 14))
    poses[:, [3, 10]] = 1.0
    poses[:, 7:9] = random.uniform(-1.0, 1.0, (PAIRS, 2)) * (radius + 0.004)
    poses[:, 9] = (ABOVE - random.uniform(-DEEP, 0.001, PAIRS)) * random.choice([-1, 1], PAIRS)
    poses[:, 11:13] = random.normal(0.0, 0.015, (PAIRS, 2))  # Tilted by up to 6 degrees.
    poses[:, 10:14] /= np.linalg.norm(poses[:, 10:14], axis=1)[:, None]
    scenes = [*found_by_mujoco(("cylinder", (radius, PEG[1])), ("box", PAD), poses)]
    (pegs, pads), (frames, turns) = (
        np.array([scene[i] for scene in scenes]).swapaxes(0, 1) for i in range(2)
    )
    own, found, gaps = _found(pads, turns, pegs, frames, radius), [], []
    for k, (*_, contacts, directions) in enumerate(scenes):
        touches, number = np.isfinite(own[2][k]), len(contacts)
        on_cap = number > 2 and abs(directions[0][2]) > 0.9
        if touches.sum() > 2 or on_cap:
            found.append(touches.any() == on_cap)
        if on_cap and touches.any():
            np.testing.assert_allclose(-own[1][k][0], directions[0], atol=1e-9)
            gaps.append(own[2][k].min() - min(contact[3] for contact in contacts))
            # Its points are on the face, too, and distances lead along the normal to the cap.
            for *point, distance in contacts:
                on_face = point + 0.5 * distance * directions[0]
                on_cap = point - 0.5 * distance * directions[0]
                assert np.abs(turns[k].T @ (on_face - pads[k]))[2] == pytest.approx(
                    PAD[2], abs=1e-12
                )
                assert np.abs(on_cap[2]) == pytest.approx(PEG[1], abs=1e-12)
    assert len(gaps) > PAIRS / 3 and np.mean(found) > 0.98
    assert np.quantile(np.abs(gaps), 0.9) < 3e-5  # [m] Deepest points; its cap has 16 corners.
