"""Captures of a garment that the package's own simulation and writers make."""

import dataclasses

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality import garment_scene, garments
from softgym_mj.reality.garment_windows import WINDOWS
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.replay import recorded_path
from softgym_mj.reality.surfaces import sample_surface

FLING = "green_tshirt_fling_2025-07-19-19-21-13"  # Counts from 0.1 s on.
GRASP = "green_tshirt_grasp_2025-07-19-19-14-03"  # From 3.8 s.
FIRST = 1.7529e9  # [s] Of the joints.
SAMPLED = 0.01  # [m]
MESH = rectangle(0.32, 0.24, 0.02)  # 17 x 13 vertices: 185 is among them.
FABRIC = dataclasses.replace(Fabric.named("rgbench_t_shirt"), thickness=garment_scene.THICKNESS)
NAMES = (*map(str, range(1, 7)), "gripper")


def camera():
    """From above, turned about Z: X to the right, Y down, Z forward."""
    angle = 0.4
    turn = np.array(
        [[np.cos(angle), np.sin(angle), 0.0], [np.sin(angle), -np.cos(angle), 0.0], [0, 0, -1.0]]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, [0.05, 0.1, 1.2]
    return matrix


def write_obj(path):
    """With a vertex that no triangle has: indices of the file are not those of the mesh."""
    path.parent.mkdir(parents=True)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in MESH.points.tolist()]
    lines += ["v 9 9 9", *(f"f {a} {b} {c}" for a, b, c in (MESH.triangles + 1).tolist())]
    path.write_text("\n".join(lines) + "\n")


def hands(action, begin=3.8, taken=(220, 0)):
    """Times (n,) [s] and where both end effectors are (n, 2, 3) [m] in the world's frame.

    To grasp they rise from `begin` [s] on, from two vertices.
    """
    start = garment_scene.laid(MESH, FABRIC)
    if action == "fling":
        times = np.arange(0.0, 1.0, 0.05)
        places = start[[185, 76]] + [0.0, 0.0, 0.3]
        way = times
    else:
        times = np.arange(0.0, 5.0, 0.05)
        places = start[list(taken)] + [0.002, -0.001, 0.004]
        way = np.maximum(times - begin, 0.0)
    return times, places + 0.15 * way[:, None, None] * [0.3, 0.0, 1.0]


def write_capture(
    folder, name, frames, shift=0.0, swapped=False, fabric=FABRIC, late=0.0, taken=(220, 0)
):
    """A capture of what is simulated, on the camera's clock; clouds are points of the surface.

    Args:
        folder, name: of the data set, and of the capture.
        frames: (n,) [s] when clouds are, by the simulation's clock.
        shift: by which clouds are too high [m].
        swapped: whether the arms' bases are exchanged.
        fabric: what it is made of.
        late: by which clouds are older than they say [s].
        taken: vertices that hands take.
    """
    garment, action = garments.case(folder / name)
    times, places = hands(action, WINDOWS[name].begin, taken)
    paths = {arm: recorded_path(times, places[:, i : i + 1]) for i, arm in enumerate(garments.ARMS)}
    window = WINDOWS[name]
    found, _ = garment_scene.replay_garment(
        MESH, fabric, action, paths, frames - late, begin=window.begin,
        held=(185, 76) if action == "fling" else None,
    )  # fmt: skip
    surface = sample_surface(MESH.points, MESH.triangles, SAMPLED)
    matrix = camera()
    clouds = [
        (surface.points(positions) + [0.0, 0.0, shift]) @ matrix[:3, :3].T + matrix[:3, 3]
        for positions in found.positions
    ]
    arms = {}
    for i, arm in enumerate(garments.ARMS):
        base = garment_scene.BASES[arm] * (-1.0 if swapped else 1.0)
        ends = places[:, i] - [0.0, base, 0.0]
        joints = np.random.default_rng(i).normal(size=(len(times), 7))
        arms[arm] = garments.JointStates(NAMES, FIRST + times, joints, ends)
    stamps = FIRST + frames - window.delay
    capture = garments.Capture(garment, action, matrix, arms, stamps, clouds)
    garments.write_capture(folder / garment / name, capture)
    return capture
