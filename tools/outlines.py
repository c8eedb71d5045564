"""Outlines of what is in an environment: boxes around parts, surfaces of objects."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from softgym_mj.entities.cup import Cup
from softgym_mj.entities.rope import Rope
from softgym_mj.entities.sheet import Sheet
from softgym_mj.envs.environment import Environment
from softgym_mj.native.meshes import tube, tube_faces
from softgym_mj.rendering.offscreen import SHOWN_SITES
from tools.silhouettes import CORNERS, boxes


def geom_corners(env: Environment, geoms: Sequence[int]) -> np.ndarray:
    """Corners (n, 8, 3) [m] of the boxes around geoms."""
    model, data = env.physics.model.ptr, env.physics.data.ptr
    middle, half = model.geom_aabb[geoms, None, :3], model.geom_aabb[geoms, None, 3:]
    turns = data.geom_xmat[geoms].reshape(-1, 3, 3)
    turned = np.einsum("gij,gkj->gki", turns, middle + CORNERS * half)
    return turned + data.geom_xpos[geoms][:, None]


def hand_corners(env: Environment) -> np.ndarray:
    """Corners (n, 8, 3) [m] of the boxes around the parts of the arms' hands."""
    model, pads = env.physics.model.ptr, env.task.actor.arm.pad_geoms
    names = [model.geom(i).name.split("/")[-1] for i in range(model.ngeom)]
    fingers = {model.geom_bodyid[i] for i, name in enumerate(names) if name in pads}
    bodies = fingers | {model.body_parentid[body] for body in fingers}
    return geom_corners(env, [i for i, body in enumerate(model.geom_bodyid) if body in bodies])


def cup_corners(cup: Cup) -> np.ndarray:
    """Outer corners (8, 3) [m]."""
    size, pose = cup.size, cup.whole_pose
    half = np.array([size.length, size.width, size.height - size.wall / 2]) / 2
    half += [size.wall, size.wall, size.wall / 2]
    middle = [0.0, 0.0, size.height / 2 - size.wall / 4]
    turn = Rotation.from_quat(pose[3:7], scalar_first=True)
    return turn.apply(middle + CORNERS * half) + pose[:3]


def mark_corners(env: Environment) -> np.ndarray:
    """Corners (n, 3) [m] of the boxes that mark the goal."""
    model, data = env.physics.model.ptr, env.physics.data.ptr
    sites = np.flatnonzero(model.site_group < SHOWN_SITES)
    turns = data.site_xmat[sites].reshape(-1, 3, 3)
    corners = np.einsum("gij,gkj->gki", turns, CORNERS * model.site_size[sites, None])
    return (corners + data.site_xpos[sites, None]).reshape(-1, 3)


def surface(env: Environment) -> np.ndarray:
    """Triangles (n, 3, 3) [m] of the object and the cups; water is in cups."""
    found = []
    for thing in env.task.scene.materials.values():
        if isinstance(thing, Sheet):
            found.append(thing.points()[thing.triangles])
        elif isinstance(thing, Rope):
            shape = {"sides": 8, "rings_per_edge": 1}
            vertices, _ = tube(thing.points(), thing.radius, **shape)
            triangles, _ = tube_faces(thing.num_points, **shape)
            found.append(vertices[triangles])
    cups = np.array([cup_corners(cup) for cup in env.task.scene.cups]).reshape(-1, 8, 3)
    return np.concatenate([*found, boxes(cups)])
