"""How well fingers hold cloth by friction alone.

- edges: arms pinch ten edges of flat cloths of different sizes, lift them by 0.2 m and carry them
  by 0.3 m at 0.6 m/s; then the hand opens and rises by 0.15 m. "held": still between the pads then;
  "known": the hand says so; "free": the hand rises without it; "fell": it is lower, too, and no
  tent that stands on the floor. `drift` is how far [mm] the held vertex has moved in the hand,
  `opening` what the cloth leaves between the pads [mm], `ms` the time of a sim step with all.
- pinch: two pads of 2 x 2 cm that press with a given force [N] lift a hanging cloth of 13 x 13
  vertices by 0.3 m at 0.6 m/s and wait for 2 s. How far it slips [mm] meanwhile, and the `gap`
  between the pads [mm].

What a grip does depends on last bits, so edges are pinched with contacts of several stiffnesses.

    python -m benchmarks.friction_grasp --arms franka sawyer --out new.json
"""

import argparse
import json
import pathlib
import time

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.entities import Cloth
from softgym_mj.entities.fabric import Fabric
from softgym_mj.envs.environment import Environment
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.tasks import Measures, Task
from softgym_mj.tasks.shared.starts.cloths import FlatCloth
from tests.scenes.grasping import (
    ENV_STEP,
    VARIATIONS,
    close_at,
    edge_place,
    go,
    lift_and_carry,
    wait,
)

FABRICS = {
    "tablecloth": Fabric(),
    "limp": Fabric(bend_stiffness=1.25e-6, density=0.2, drag=0.0),
}
STIFFNESS = 2000.0  # [N/m] Stiffness of the plugin's contacts.
SHARES = (0.95, 1.0, 1.05)  # Factors of this stiffness.
FORCES = (0.5, 1.0, 3.0, 10.0)  # [N] Forces of the pinch.
PAD, SPAN = 0.01, 0.025  # [m] Half size and opening of the pads.


def make_cloth(fabric: str, stiffness: float, **attributes) -> Cloth:
    """A cloth whose contacts have a stiffness of their own."""
    cloth = Cloth(fabric=FABRICS[fabric], **attributes)
    instance = cloth.mjcf_model.extension.plugin[0].instance[0]
    instance.add("config", key="contact_stiffness", value=repr(stiffness))
    return cloth


class Edge(Task):
    """A flat cloth, as in the variations of `fold_cloth`."""

    def __init__(self, arm: str, variation: int, fabric: str, stiffness: float):
        """Builds it for an arm."""
        start = FlatCloth("default")
        self.cloth = make_cloth(fabric, stiffness, dims=start.dims(variation))
        self.angle = start.angle(variation)
        super().__init__([self.cloth], actor=arm, arms=1, grasp="friction")

    def arrange(self, random):
        self.cloth.set_points(self.cloth.flat(angle=self.angle))

    def measure(self, state, episode):
        return Measures(0.0, {"nothing": 0.0})


def pinch_edge(arm: str, variation: int, fabric: str, stiffness: float) -> dict[str, object]:
    """Pinches, lifts, carries and lets go of an edge."""
    env = Environment(Edge(arm, variation, fabric, stiffness), name="edge", horizon=1000)
    env.reset(variation)
    actor, cloth = env.task.actor, env.task.cloth

    def offset(vertex):
        return cloth.vertex(vertex) - actor.positions()[0]

    close_at(env, edge_place(env))
    vertex = int(np.linalg.norm(cloth.displacements_from(actor.positions()[0]), axis=1).argmin())
    pinched = offset(vertex)
    lift_and_carry(env)
    start = time.thread_time(), env.physics.data.time
    wait(env, True, round(1.0 / ENV_STEP))
    cost = 1e3 * (time.thread_time() - start[0]) / (env.physics.data.time - start[1]) * 0.01
    drift, height = np.linalg.norm(offset(vertex) - pinched), cloth.vertex(vertex)[2]
    opening = env.physics.data.qpos[actor.servos.fingers.positions_at[0]].sum()
    held = drift < 0.05 and height > 0.15 and opening > 0.001
    known = actor.held[0] >= 0
    wait(env, False, 6)
    go(env, actor.commanded_positions()[0] + [0.0, 0.0, 0.15], False, 0.4)
    free = held and offset(vertex)[2] < -0.12
    fell = free and cloth.vertex(vertex)[2] < height - 0.03
    return {
        "variation": variation, "held": bool(held), "known": bool(known), "fell": bool(fell),
        "free": bool(free),
        "drift": 1e3 * drift, "opening": 1e3 * opening, "height": 1e3 * height, "ms": cost,
    }  # fmt: skip


def pinch_all(arm: str, fabric: str, share: float) -> dict[str, object]:
    """All edges with one stiffness of the contacts."""
    edges = [pinch_edge(arm, v, fabric, share * STIFFNESS) for v in VARIATIONS]
    return {
        "arm": arm, "fabric": fabric, "share": share,
        **{name: sum(edge[name] for edge in edges) for name in ("held", "known", "free", "fell")},
        "edges": edges,
    }  # fmt: skip


def pinch(force: float, fabric: str) -> dict[str, object]:
    """Two pads on slides lift a hanging cloth."""
    cloth = make_cloth(fabric, STIFFNESS, dims=(59, 59))  # 13 x 13 vertices.
    root = mjcf.RootElement(model="pinch")
    root.option.timestep, root.option.integrator = cloth.timestep, "discrete"
    root.option.jacobian = "sparse"
    root.size.memory = "16M"
    root.worldbody.add("geom", type="plane", size=[2, 2, 1], conaffinity=3)
    hand = root.worldbody.add("body", name="hand", pos=[0, 0, 0.6])
    hand.add("inertial", pos=[0, 0, 0], mass=1.0, diaginertia=[1e-3] * 3)
    hand.add("joint", name="lift", type="slide", axis=[0, 0, 1])
    root.actuator.add("position", name="lift", joint="lift", kp=20000, kv=1500)
    for name, side in (("left", 1.0), ("right", -1.0)):
        finger = hand.add("body", name=name, pos=[side * PAD, 0, 0])
        finger.add("joint", name=name, type="slide", axis=[side, 0, 0], damping=1, armature=0.1)
        finger.add(
            "geom", name=name, type="box", size=[PAD] * 3, mass=0.015, contype=2, conaffinity=0,
            friction=[1.5, 0.05, 0.001], priority=1,
        )  # fmt: skip
        root.actuator.add("motor", name=name, joint=name)
    root.attach(cloth.mjcf_model)
    physics = mjcf.Physics.from_mjcf_model(root)
    cloth.after_compile(physics, None)
    model, data = physics.model.ptr, physics.data.ptr
    # It hangs in the plane between the pads, its upper edge 1 cm above their middle.
    rest = cloth.flat()
    cloth.set_points(np.column_stack([0 * rest[:, 0], rest[:, 0], rest[:, 1] - rest[:, 1].max()]))
    vertices = cloth.points() + [0.0, 0.0, 0.61]
    cloth.set_points(vertices)
    top = cloth.index(0, cloth.shape[1] // 2)
    fingers = [model.joint(n).qposadr[0] for n in ("left", "right")]
    data.qpos[fingers] = SPAN / 2
    lift, left, right = (model.actuator(n).id for n in ("lift", "left", "right"))
    mujoco.mj_forward(model, data)
    corners = [cloth.index(0, 0), cloth.index(0, cloth.shape[1] - 1)]
    for corner in corners:
        cloth.hold(corner)

    def step(seconds, height=0.0):
        for _ in range(round(seconds / cloth.timestep)):
            wanted = min(data.ctrl[lift] + 0.6 * cloth.timestep, height)
            data.ctrl[lift] = wanted
            mujoco.mj_step(model, data)

    for _ in range(30):
        for corner in corners:
            cloth.drive(corner, vertices[corner], cloth.timestep)
        step(cloth.timestep)
    data.ctrl[[left, right]] = -force
    for _ in range(50):
        for corner in corners:
            cloth.drive(corner, vertices[corner], cloth.timestep)
        step(cloth.timestep)
    for corner in corners:
        cloth.release(corner)
    at = data.qpos[model.joint("lift").qposadr[0]]
    start = cloth.vertex(top)[2] - at
    step(0.3 / 0.6, 0.3)
    lifted = cloth.vertex(top)[2] - data.qpos[model.joint("lift").qposadr[0]]
    step(2.0, 0.3)
    end = cloth.vertex(top)[2] - data.qpos[model.joint("lift").qposadr[0]]
    return {
        "force": force, "fabric": fabric, "slip_lifting": 1e3 * abs(lifted - start),
        "slip": 1e3 * abs(end - start), "gap": 1e3 * data.qpos[fingers].sum(),
        "height": 1e3 * cloth.vertex(top)[2],
    }  # fmt: skip


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--arms", nargs="*", default=list(ARMS))
    parser.add_argument("--fabric", default="tablecloth", choices=FABRICS)
    parser.add_argument("--shares", nargs="*", type=float, default=SHARES)
    parser.add_argument("--forces", nargs="*", type=float, default=FORCES)
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    found: dict[str, list] = {"edges": [], "pinch": []}
    for force in arguments.forces:
        found["pinch"].append(pinch(force, arguments.fabric))
        print(json.dumps(found["pinch"][-1]), flush=True)
    for arm in arguments.arms:
        for share in arguments.shares:
            found["edges"].append(pinch_all(arm, arguments.fabric, share))
            row = found["edges"][-1]
            print({k: v for k, v in row.items() if k != "edges"})
            for edge in row["edges"]:
                print("  ", json.dumps(edge), flush=True)
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
