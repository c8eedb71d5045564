"""Two pick-and-place rollouts on a cloth, as SoftGym's paper showed beside a real Sawyer: here
without a real robot, but with distances.

Three columns play the same motion on the same cloth: the abstract picker; a simulated Sawyer, whose
parallel gripper pinches the cloth's edge and holds it by friction alone; another engine, MuJoCo's
own flex, whose vertex goes the way of the picker's. Each rollout is repeated with picks that are
5 mm off (standard deviation along X and Y) and with fabrics drawn from the tasks' usual ranges,
without air, the same in all columns.

    python -m benchmarks.engines.demonstration --folder build/engines --out docs/demonstration.json
    python -m benchmarks.engines.demonstration --picture docs/demonstration.jpg
"""

import argparse
import dataclasses
import json
import logging
import pathlib
from collections.abc import Callable

import numpy as np

import softgym_mj
from benchmarks.engines import motions, stock, study
from benchmarks.engines.motions import Motion
from benchmarks.engines.sheets import FABRIC
from benchmarks.friction_grasp import BEYOND, CLOSING, ENV_STEP, go, wait
from softgym_mj import metrics
from softgym_mj.entities.sheet import Fabric
from softgym_mj.envs.environment import Environment
from softgym_mj.jobs.store import ARRAYS, Store
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.replay import Hold, recorded_path
from softgym_mj.rendering.offscreen import CameraView

VARIATION = 804  # A cloth of 0.55 x 0.54 m, turned by 6 degrees only.
REPEATS = 10
PICK_NOISE = 0.005  # [m]
DRAWN = ("stretch_stiffness", "bend_stiffness", "density", "friction")  # From the usual range.

# Row and column of the vertex that is taken, both at the side of the arm, and the way [m] on.
ROLLOUTS = {"edge": ((12, 0), (0.5, 0.0)), "corner": ((17, 0), (0.2, 0.15))}
LIFTED, LAID = 0.12, 0.03  # [m] Heights of the hand.
LIFT_SPEED, CARRY_SPEED, LOWER_SPEED = 0.3, 0.3, 0.2  # [m/s]
SHOWN, IMAGE = ("carry", "release"), (300, 360)  # In the picture; height and width [pixels].
REST = 15  # Env steps after it is let go of.
COLUMNS = {"picker": "abstract picker", "sawyer": "simulated Sawyer", "mujoco": "MuJoCo's flex"}
MOMENTS = ("lift", "carry", "place", "release")
_ABOVE = 0.05  # [m] From a vertex to the picker that takes it.


@dataclasses.dataclass
class Rollout:
    """What came out.

    Attributes:
        moments: vertices (n, 3) [m] at the start and at `MOMENTS`, in order.
        times: (m,) [s] at which the following was noted, from the grip to the release.
        path: where the vertex that was taken was (m, 3) [m].
        ends: (4,) [s] of `MOMENTS`.
        vertex: the one that was taken.
        held: whether it was still held when it was to be let go of.
    """

    moments: np.ndarray
    times: np.ndarray
    path: np.ndarray
    ends: np.ndarray
    vertex: int
    held: bool


def draw(repeat: int) -> tuple[np.ndarray, Fabric]:
    """By how much the pick is off (2,) [m], and the fabric, of a repeat; the first one is exact."""
    random = np.random.default_rng(repeat)
    if repeat == 0:
        return np.zeros(2), FABRIC
    usual = {p.name: p.usual for p in Fabric().parameters}
    drawn = {name: float(random.uniform(*usual[name])) for name in DRAWN}
    fabric = dataclasses.replace(FABRIC, **drawn, layer_friction=drawn["friction"])
    return random.normal(0.0, PICK_NOISE, 2), fabric


def scene(actor: str, fabric: Fabric, look: str = "fast") -> Environment:
    """The task with one gripper and a fabric."""
    numbers = {name: getattr(fabric, name) for name in (*DRAWN, "layer_friction", "drag")}
    kind = {"num_pickers": 1} if actor == "picker" else {"arms": 1, "grasp": "friction"}
    env = softgym_mj.load(
        "fold_cloth", actor=actor, split="evaluate", domain=numbers, look=look, **kind
    )
    env.reset(VARIATION)
    return env


def act(
    env: Environment,
    rollout: str,
    off: np.ndarray,
    see: Callable[[str], None] = lambda moment: None,
) -> Rollout:
    """Plays a rollout with whatever hand the environment has; `see` is called at `MOMENTS`."""
    (row, column), way = ROLLOUTS[rollout]
    cloth, actor, data = env.task.cloth, env.task.actor, env.physics.data
    aim = cloth.vertex(cloth.index(row, column))
    is_picker = actor.name == "picker"
    # Pads straddle the edge, which is at -X; a picker comes from above.
    place = aim[:2] + off - [0.0 if is_picker else BEYOND, 0.0]
    low = aim[2] + _ABOVE if is_picker else actor.limits[0][2]
    start = cloth.points()
    go(env, np.array([[*place, 0.2]]), False, 0.6)
    go(env, np.array([[*place, low]]), False, 0.2)
    wait(env, True, CLOSING)
    begin = data.time
    distances = np.linalg.norm(cloth.offsets(actor.positions()[0]), axis=1)
    vertex = int(actor.held[0]) if actor.held[0] >= 0 else int(distances.argmin())
    times, path, moments, ends = [0.0], [cloth.vertex(vertex)], [start], []
    pinched = cloth.vertex(vertex) - actor.positions()[0]

    def note():
        times.append(data.time - begin)
        path.append(cloth.vertex(vertex))

    offset = low - aim[2] if is_picker else 0.0
    at = actor.commanded_positions()[0]
    over = at + [*way, 0.0]
    legs = (
        ([*at[:2], LIFTED + offset], LIFT_SPEED),
        ([*over[:2], LIFTED + offset], CARRY_SPEED),
        ([*over[:2], LAID + offset], LOWER_SPEED),
    )
    for moment, (goal, speed) in zip(MOMENTS, legs, strict=False):
        _carry(env, np.array([goal]), speed, note)
        see(moment)
        moments.append(cloth.points())
        ends.append(times[-1])
    away = np.linalg.norm(cloth.vertex(vertex) - actor.positions()[0] - pinched)
    held = bool(away < 0.03)
    wait(env, False, 4)
    go(env, actor.commanded_positions() + [0.0, 0.0, 0.15], False, 0.4)
    while data.time - begin < ends[-1] + REST * ENV_STEP:
        wait(env, False, 1)
    see(MOMENTS[-1])
    moments.append(cloth.points())
    ends.append(data.time - begin)
    return Rollout(np.array(moments), np.array(times), np.array(path), np.array(ends), vertex, held)


def _carry(env: Environment, goal: np.ndarray, speed: float, note) -> None:
    """Like `go`, closed, and notes each env step."""
    actor = env.task.actor
    for _ in range(60):
        way = (goal - actor.commanded_positions()) / ENV_STEP
        way *= speed / max(np.abs(way).max(), speed)
        env.step(np.column_stack([way, np.ones(1)]).ravel())
        note()
        if np.abs(actor.positions() - goal).max() < 0.004:
            return


def again(first: Rollout, mesh: Mesh, fabric: Fabric) -> Rollout:
    """The picker's rollout in MuJoCo's flex: the same vertex goes the same way."""
    hold = Hold(
        (first.vertex,), recorded_path(first.times, first.path[:, None]), 0.0, first.times[-1]
    )
    moments = dict(zip(MOMENTS, first.ends.tolist(), strict=True))
    motion = Motion(first.moments[0], -motions.STEP, (hold,), moments)
    replay = motions.play(stock.ENGINE, mesh, fabric, motion)
    positions = np.concatenate([first.moments[:1], replay.positions])
    return dataclasses.replace(first, moments=positions)


def play(rollout: str, repeat: int, scale: dict[str, float]) -> dict[str, np.ndarray]:
    """All columns of a repeat: arrays by column and what they are, and the scores."""
    off, fabric = draw(repeat)
    found, scores = {}, {}
    for actor in ("picker", "sawyer"):
        env = scene(actor, fabric)
        found[actor] = act(env, rollout, off)
        shape, start = env.task.cloth.arrays, found[actor].moments[0]
        goal = env.task.cloth.particles(start)
        env.close()
    mesh = Mesh(env.task.cloth.flat() * [1.0, 1.0, 0.0], env.task.cloth.triangles)
    given = {name: factor * getattr(fabric, name) for name, factor in scale.items()}
    found["mujoco"] = again(found["picker"], mesh, dataclasses.replace(fabric, **given))
    lowest = float(metrics.fold(shape, start, goal).performance)
    for name, result in found.items():
        last = float(metrics.fold(shape, result.moments[-1], goal).performance)
        scores[name] = (last - lowest) / (0.0 - lowest)
    arrays = {f"{name}_moments": result.moments for name, result in found.items()}
    arrays |= {f"{name}_score": np.array(score) for name, score in scores.items()}
    arrays |= {f"{name}_vertex": np.array(result.vertex) for name, result in found.items()}
    arrays |= {f"{name}_held": np.array(result.held) for name, result in found.items()}
    return arrays | {"off": off, "triangles": mesh.triangles}


def summary(runs: dict[tuple[str, int], dict[str, np.ndarray]]) -> dict:
    """The result file."""
    rows = {}
    for (rollout, repeat), run in runs.items():
        row = {
            "off_mm": 1e3 * run["off"],
            "fabric": {name: getattr(draw(repeat)[1], name) for name in DRAWN},
        }
        for name in COLUMNS:
            row[name] = {
                "score": run[f"{name}_score"],
                "vertex": run[f"{name}_vertex"],
                "held": run[f"{name}_held"],
            }
            if name != "picker":
                apart = study.distance(run[f"{name}_moments"], run["picker_moments"])
                row[name]["distance_mm"] = dict(zip(MOMENTS, apart[1:].tolist(), strict=True))
        rows.setdefault(rollout, []).append(row)
    return json.loads(
        json.dumps({"rollouts": rows}, default=lambda value: np.asarray(value).tolist())
    )


def draw_picture(file: pathlib.Path, scale: dict[str, float]) -> None:
    """Draws both rollouts, unperturbed, when the cloth is carried and at the end."""
    import matplotlib.pyplot as plt

    figure, grid = plt.subplots(
        len(ROLLOUTS) * len(SHOWN), len(COLUMNS), figsize=(9.0, 2.6 * len(ROLLOUTS) * len(SHOWN)),
        layout="constrained",
    )  # fmt: skip
    rows = iter(grid)
    for rollout in ROLLOUTS:
        images = photographs(rollout, scale)
        for moment in SHOWN:
            for axes, (name, title) in zip(next(rows), COLUMNS.items(), strict=True):
                axes.imshow(images[name, moment])
                axes.set_title(f"{title}: {rollout}, {moment}", fontsize="small")
                axes.axis("off")
    figure.suptitle("Simulation only: no real robot")
    figure.savefig(file, dpi=90, pil_kwargs={"quality": 85})


def photographs(rollout: str, scale: dict[str, float]) -> dict[tuple[str, str], np.ndarray]:
    """Images (h, w, 3) of a rollout by column and moment."""
    images = {}
    off, fabric = draw(0)
    camera = CameraView("task", *IMAGE)
    for actor in ("picker", "sawyer"):
        env = scene(actor, fabric, look="paper")

        def see(moment, actor=actor, env=env):
            if moment in SHOWN:
                images[actor, moment] = camera.rgb(env.physics)

        found = act(env, rollout, off, see)
        if actor == "picker":
            cloth = env.task.cloth
            mesh = Mesh(cloth.flat() * [1.0, 1.0, 0.0], cloth.triangles)
            given = {name: factor * getattr(fabric, name) for name, factor in scale.items()}
            other = again(found, mesh, dataclasses.replace(fabric, **given))
            for moment in SHOWN:  # The picker is where it ended, above.
                cloth.set_points(other.moments[1 + MOMENTS.index(moment)])
                env.physics.data.ptr.time += 1.0  # Something has changed: draw anew.
                images["mujoco", moment] = camera.rgb(env.physics)
        env.close()
    return images


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=pathlib.Path, default="build/engines")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--picture", type=pathlib.Path, help="draw the first repeats, no more")
    arguments = parser.parse_args()
    logging.getLogger("absl").setLevel(logging.ERROR)  # Of flexes that are stiff.
    given = study.calibrated(arguments.folder, stock.ENGINE).given
    scale = {name: number / getattr(FABRIC, name) for name, number in given.items()}
    if arguments.picture:
        draw_picture(arguments.picture, scale)
        return
    store = Store(arguments.folder / "demonstration", {"scale": scale, "version": 1}, ARRAYS)
    runs = {}

    def note(key, value):
        runs[key] = value
        scores = {name: round(float(value[f"{name}_score"]), 3) for name in COLUMNS}
        print(*key, scores, {n: bool(value[f"{n}_held"]) for n in COLUMNS}, flush=True)

    keys = [(rollout, repeat) for repeat in range(arguments.repeats) for rollout in ROLLOUTS]
    store.run(keys, lambda rollout, repeat: play(rollout, repeat, scale), progress=note)
    if arguments.out:
        arguments.out.write_text(json.dumps(summary(runs), indent=1) + "\n")


if __name__ == "__main__":
    main()
