"""Measures cloth and rope of one checkout for `benchmarks.cloth`, which starts it as a process.

It answers requests on its standard input, a line of JSON each, by lines of figures.
"""

import json
import sys
import time
from collections.abc import Callable
from unittest import mock

DIMS = {21: 97, 27: 126, 33: 155, 41: 193}  # Sizes in SoftGym's particles, of n x n vertices.
PICK = (0.2, 0.7)  # The vertex that is lifted, as shares of the rows and columns.
LIFT, LIFT_SPEED, HOLD, DROP = 0.6, 1.0, 1.5, 6.0  # [m], [m/s], [s], [s]
SIM_STEP = 0.01  # [s]
FLAT_STEPS, RELEASE_STEPS, REST_STEPS, PILE_STEPS = 100, 30, 70, 200
INTERVAL = 10  # Sim steps between two counts of intersections.
YARDSTICK_STEPS = 1500

Figures = dict[str, float]


class Clock:
    """Stands in for `mujoco.mj_step` and keeps the thread CPU time [ms] of every call."""

    def __init__(self):
        import mujoco

        self.times: list[float] = []
        self._step = mujoco.mj_step

    def __call__(self, model, data) -> None:
        start = time.thread_time()
        self._step(model, data)
        self.times.append(1e3 * (time.thread_time() - start))


def measure_fold(size: int, speed: float) -> Figures:
    """Phases of a fold, and how the cloth came through."""
    import mujoco
    import numpy as np

    from softgym_mj.entities.cloth import Cloth
    from tests.scenes.manipulation import ManipulationScene, fold

    clock = Clock()
    scene = ManipulationScene(Cloth(dims=(DIMS[size],) * 2))
    with mock.patch.object(mujoco, "mj_step", clock):
        for _ in range(FLAT_STEPS):
            scene.step(np.zeros((2, 3)), grip=False)
        fold(scene, speed, rest=SIM_STEP * (RELEASE_STEPS + REST_STEPS))
    times = np.array(clock.times)
    flat, after = times[:FLAT_STEPS], times[-RELEASE_STEPS - REST_STEPS :]
    lift, carry, lower = np.array_split(times[FLAT_STEPS + 1 : -len(after)], 3)
    phases = {"flat": flat, "lift": lift, "carry": carry, "lower": lower,
              "release": after[:RELEASE_STEPS], "rest": after[RELEASE_STEPS:],
              "fold": np.concatenate([lower, after]), "all": times[FLAT_STEPS:]}  # fmt: skip
    return {
        **{f"{name}_ms": float(np.mean(phase)) for name, phase in phases.items()},
        "strain_99": scene.record.strain_99,
        "lowest_mm": 1e3 * scene.record.lowest,
        "hits": max(scene.record.most_intersections, scene.record.end_intersections),
    }


def measure_pile(size: int) -> Figures:
    """A crumpled cloth that comes to rest."""
    import numpy as np

    from softgym_mj.entities.arena import Arena
    from softgym_mj.entities.cloth import Cloth

    arena, cloth, clock = Arena("cloth"), Cloth(dims=(DIMS[size],) * 2), Clock()
    arena.attach(cloth)
    physics = arena.compile(SIM_STEP, cloth)
    cloth.set_points(cloth.flat())
    vertex = cloth.index(*(round(share * (size - 1)) for share in PICK))
    goal, hits, strain = cloth.vertex(vertex), 0, 0.0
    cloth.hold(vertex)
    lifting, dropping = round(LIFT / LIFT_SPEED / SIM_STEP), round((DROP) / SIM_STEP)
    ends = np.cumsum([lifting, round(HOLD / SIM_STEP), dropping])
    for step in range(ends[2]):
        if step == ends[1]:
            cloth.release_all()
        if step < ends[1]:
            goal[2] += SIM_STEP * LIFT_SPEED * (step < ends[0])
            cloth.drive(vertex, goal, SIM_STEP)
        clock(physics.model.ptr, physics.data.ptr)
        if step % INTERVAL == 0:
            hits = max(hits, cloth.intersections())
            strain = max(strain, float(np.percentile(cloth.edge_strain(), 99)))
        if step == ends[2] - 1 - round(1.0 / SIM_STEP):
            before = cloth.points()
    times = np.array(clock.times)
    return {
        "lift_ms": float(times[: ends[0]].mean()),
        "hang_ms": float(times[ends[0] : ends[1]].mean()),
        "fall_ms": float(times[ends[1] : ends[1] + 50].mean()),
        "pile_ms": float(times[-PILE_STEPS:].mean()),
        "strain_99": strain,
        "lowest_mm": 1e3 * float(cloth.points()[:, 2].min()),
        "drift_mm/s": 1e3 * float(np.linalg.norm(cloth.points() - before, axis=1).mean()),
        "hits": hits,
    }


def measure_task(task: str, policy: str, variation: int) -> Figures:
    """Env steps in a second of CPU time in an episode, and the score at its end."""
    import numpy as np

    import softgym_mj
    from softgym_mj.policies.experts import make_policy

    env = softgym_mj.load(task, split="evaluate", observation="reduced")
    random = np.random.default_rng(variation)
    act = make_policy(env) if policy == "expert" else None
    timestep, seconds, steps = env.reset(variation), 0.0, 0
    while not timestep.last():
        if act is None:
            action = random.choice([-1.0, 1.0], env.action_spec().shape)
            action.reshape(2, 4)[:, :3] *= random.uniform(0, 1, (2, 3))
            action.reshape(2, 4)[:, 3] = 1.0
        else:
            action = act(timestep)
        start = time.thread_time()
        timestep = env.step(action)
        seconds += time.thread_time() - start
        steps += 1
    return {"env_steps/s": steps / seconds, "score": env.info()["normalized_performance"]}


def measure_yardstick() -> Figures:
    """Speed of dm_control's humanoid, which moves at random."""
    import mujoco
    import numpy as np
    from dm_control import suite

    physics = suite.load("humanoid", "stand", task_kwargs={"random": 0}).physics
    model, data = physics.model.ptr, physics.data.ptr
    controls = np.random.default_rng(0).uniform(-1, 1, (YARDSTICK_STEPS, model.nu))
    start = time.thread_time()
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
    return {"mj_steps/s": YARDSTICK_STEPS / (time.thread_time() - start)}


MEASURES: dict[str, Callable[..., Figures]] = {
    "fold": measure_fold, "pile": measure_pile, "task": measure_task,
    "yardstick": measure_yardstick,
}  # fmt: skip


def work() -> None:
    """Answers requests, a line of JSON each, until there are no more."""
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        print(json.dumps(MEASURES[name](*arguments)), file=answers, flush=True)


if __name__ == "__main__":
    work()
