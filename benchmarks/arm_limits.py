"""What arms do at their limits: how far they reach, where they stop, how hard they press.

One arm that stands at (0, -0.7) m and faces +Y, with the physics step and the solver of a cloth or
a rope that lies out of reach.

- reach: where the hand gets to when it is sent away straight ahead, and to the side at y = -0.3 m
  [m], at heights over the floor; in the drop tasks the base is 0.5 m high.
- stops: how far the hand, and the path that it is led along, go on along the way of a command of
  0.25 s that ends at once: the farthest of six directions [mm].
- pressing: forces and torques of a hand that is driven into the table of a task, and held there.

    python benchmarks/arm_limits.py --out new.json
"""

import argparse
import json
import pathlib

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.rope import Rope
from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.workspace import Workspace

WORKSPACE = Workspace((-1.5, -1.5, 0.0), (1.5, 1.5, 1.5))
START = np.array([0.0, -0.25, 0.3])  # [m] Over the mounting plane, well within reach.
AWAY = 1.2  # [m] Beyond every reach.
SIDE = -0.3  # [m] Y at which the reach to the side is measured.
HEIGHTS = {0.0: (0.02, 0.2, 0.4, 0.6), 0.5: (0.05, 0.3, 0.5, 0.7, 0.9)}  # [m] By base height.
SPEEDS = (0.3, 0.5, 0.6, 1.0)  # [m/s]
TABLE = 0.1  # [m] Height of the table's top.
SOLID = 3  # `conaffinity` of a geom that hands and objects touch.


class World:
    """One arm and an object that lies out of reach."""

    def __init__(self, arm: str, kind: str = "rope", base_height: float = 0.0, table: float = 0.0):
        target = Cloth(dims=(20, 20), fidelity="fast") if kind == "cloth" else Rope("fast")
        arena, self.arms = Arena(), Arms(ARMS[arm], 1, base_height)
        if table:
            arena.mjcf_model.worldbody.add(
                "geom", type="box", pos=[0, 0, table / 2], size=[0.4, 0.3, table / 2],
                conaffinity=SOLID,
            )  # fmt: skip
        arena.attach(target)
        self.arms.join(arena)
        self.arms.manipulate(target)
        physics = arena.compile(target.timestep, target, self.arms)
        self.model, self.data = physics.model.ptr, physics.data.ptr
        target.set_points(target.points() + [3.0, 0.0, target.radius])
        self.arms.place(START[None] + [0.0, 0.0, base_height], WORKSPACE)
        mujoco.mj_forward(self.model, self.data)

    def step(self, velocity: np.ndarray) -> None:
        """A sim step with the commanded point at a velocity (3,) [m/s]."""
        self.arms.command(np.append(velocity, -1.0))
        self.arms.plan()
        number = round(SIM_STEP / self.model.opt.timestep)
        for i in range(number):
            self.arms.move((i + 1) / number, self.model.opt.timestep)
            mujoco.mj_step(self.model, self.data)

    def go(self, goal: np.ndarray, seconds: float, speed: float = 0.4) -> None:
        """Sends the commanded point to `goal` (3,) [m], and waits there."""
        for _ in range(round(seconds / SIM_STEP)):
            way = (goal - self.arms.commanded_positions()[0]) / SIM_STEP
            self.step(way * min(1.0, speed / max(np.linalg.norm(way), 1e-9)))


def reach(arm: str, base_height: float) -> list[dict[str, object]]:
    """Where the hand gets to at each height [m]."""
    rows = []
    for height in HEIGHTS[base_height]:
        row: dict[str, object] = {"height": height}
        for name, start, end in (
            ("ahead", (0.0, -0.25), (0.0, AWAY)),
            ("aside", (0.0, SIDE), (AWAY, SIDE)),
        ):
            world = World(arm, base_height=base_height)
            world.go(np.array([*start, height]), 4.0)
            for way in np.linspace(start, end, 20):
                world.go(np.array([*way, height]), 0.3)
            world.go(np.array([*end, height]), 2.0)
            told, hand = world.arms.commanded_positions()[0], world.arms.positions()[0]
            axis = 1 if name == "ahead" else 0
            row[name] = [round(float(told[axis]), 3), round(float(hand[axis]), 3)]
            row[f"{name}_off_mm"] = round(1000 * float(np.linalg.norm(told - hand)), 1)
        rows.append(row)
    return rows


def stops(arm: str, kind: str) -> dict[float, dict[str, float]]:
    """How far the hand and its path go on after a command has ended [mm], by speed."""
    result = {}
    for speed in SPEEDS:
        beyond = np.zeros(2)
        for way in (*np.eye(3), *-np.eye(3)):
            world = World(arm, kind)
            world.go(START - 0.125 * speed * way, 2.0)
            for _ in range(25):
                world.step(speed * way)
            goal = world.arms.commanded_positions()[0]
            for _ in range(80):
                world.step(np.zeros(3))
                points = (world.arms.positions()[0], world.arms.reference_positions()[0])
                beyond = np.maximum(beyond, [(point - goal) @ way for point in points])
        result[speed] = dict(zip(("hand", "path"), np.round(1000 * beyond, 1), strict=True))
    return result


def pressing(arm: str, kind: str) -> dict[str, object]:
    """A hand that is sent into a table: force [N], torques over the motors' limits."""
    world, limits = World(arm, kind, table=TABLE), np.array(ARMS[arm].torque_limits)
    over = np.array([0.0, -0.2, 2 * TABLE])
    world.go(over, 3.0)
    world.go(over * [1.0, 1.0, 0.0], 10.0)
    model, data, motors = world.model, world.data, world.arms.servos.motors
    force, total = np.zeros(6), 0.0
    for i in range(data.ncon):
        if data.contact.geom[i].min() >= 0:  # No flex.
            mujoco.mj_contactForce(model, data, i, force)
            total += force[0]
    return {
        "force": round(total),
        "torques": np.round(np.abs(data.actuator_force[motors]), 1).tolist(),
        "share": np.round(np.abs(data.actuator_force[motors]) / limits, 2).tolist(),
        "widened": np.round(model.actuator_forcerange[motors, 1] / limits, 2).tolist(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    results: dict[str, dict] = {}
    for arm in ARMS:
        results[arm] = {
            **{f"reach_{height:g}": reach(arm, height) for height in HEIGHTS},
            **{f"stops_{kind}": stops(arm, kind) for kind in ("cloth", "rope")},
            **{f"pressing_{kind}": pressing(arm, kind) for kind in ("cloth", "rope")},
        }
        for name, result in results[arm].items():
            print(arm, name)
            for row in result if isinstance(result, list) else result.items():
                print("   ", row, flush=True)
    if arguments.out:
        arguments.out.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
