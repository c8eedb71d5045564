"""Contact points of boxes with boxes and capsules, against MuJoCo."""

import jax
import mujoco
import numpy as np

from softgym_mj.robots.arm_batch import boxes

PAIRS = 400


def found_by_mujoco(first, second, poses):
    """MuJoCo's contacts of two geoms of free bodies, at poses (n, 14)."""
    bodies = "".join(
        f"<body><freejoint/><geom type='{kind}' size='{' '.join(map(str, size))}' mass='1'/></body>"
        for kind, size in (first, second)
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    for data.qpos[:] in poses:
        mujoco.mj_forward(model, data)
        found = [np.append(contact.pos, contact.dist) for contact in data.contact]
        normals = [contact.frame[:3].copy() for contact in data.contact]
        yield data.geom_xpos.copy(), data.geom_xmat.reshape(2, 3, 3).copy(), found, normals


def _poses(reach):
    """Random poses (PAIRS, 14) of two solids, two of three with nearly parallel edges."""
    random = np.random.default_rng(0)
    poses = np.zeros((PAIRS, 14))
    poses[:, 7:10] = random.uniform(-0.6, 0.6, (PAIRS, 3)) * reach
    for first in (3, 10):
        poses[:, first : first + 4] = random.normal(size=(PAIRS, 4))
        poses[::3, first + 1 : first + 4] *= [0.002, 0.002, 1.0]
        poses[1::3, first : first + 4] = [1.0, *random.normal(0.0, 1e-3, 3)]
        poses[:, first : first + 4] /= np.linalg.norm(poses[:, first : first + 4], axis=1)[:, None]
    return poses


def _found(function, scenes, sizes):
    positions, rotations = (np.array([scene[i] for scene in scenes]) for i in range(2))
    solids = ((positions[:, i], rotations[:, i], np.tile(sizes[i], (PAIRS, 1))) for i in range(2))
    with jax.enable_x64(True):
        found = jax.jit(jax.vmap(function))(*solids)
    return [np.asarray(array) for array in found]


def test_boxes_touch_at_the_points_of_mujoco():
    sizes, numbers = ((0.009, 0.004, 0.01), (0.01, 0.002, 0.0125)), set()
    scenes = [*found_by_mujoco(*(("box", size) for size in sizes), _poses(np.sum(sizes, axis=0)))]
    own = zip(*_found(boxes.box_box, scenes, sizes), strict=True)
    for (points, normals, distances), (*_, contacts, directions) in zip(own, scenes, strict=True):
        touch, expected = np.isfinite(distances), np.reshape(contacts, (-1, 4))
        found = np.column_stack([points, distances])[touch]
        assert len(found) == len(expected)
        numbers.add(len(found))
        if len(found):  # In any order.
            away = np.linalg.norm(found[:, None] - expected, axis=-1)
            assert max(away.min(0).max(), away.min(1).max()) < 1e-9
            np.testing.assert_allclose(normals[touch], directions, atol=1e-9)
    assert {0, 1, 2, 3, 4, 5, 6} <= numbers


def test_capsules_touch_boxes_at_the_deepest_point_of_mujoco():
    sizes, rested = ((0.035, 0.067), (0.05, 0.08, 0.03)), 0
    reach = np.add(sum(sizes[0]), sizes[1])
    scenes = [*found_by_mujoco(("capsule", sizes[0]), ("box", sizes[1]), _poses(reach))]
    own = zip(*_found(boxes.capsule_box, scenes, sizes), strict=True)
    for (points, normals, distances), (*_, expected, directions) in zip(own, scenes, strict=True):
        if distances[0] < -0.99 * sizes[0][0]:
            continue  # Where the segment enters the box, MuJoCo's point is another one.
        assert bool(expected) == np.isfinite(distances[0])
        if not expected:
            continue
        np.testing.assert_allclose(np.append(points[0], distances[0]), expected[0], atol=1e-8)
        np.testing.assert_allclose(normals[0], directions[0], atol=1e-8)
        if len(expected) == 2 and np.linalg.norm(np.subtract(*expected)) > 0.01:
            away = np.append(points[1], distances[1]) - expected[1]
            rested += np.linalg.norm(away) < 1e-8
    assert rested > 10
