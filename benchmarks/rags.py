"""Both primitives of the rags' benchmark at true mass: who runs them, how well, how fast.

    python -m benchmarks.rags --folder out/rags --out docs/rags.json

Ten measured fabrics at 0.15, 0.2 and 0.3 kg/m^2 in this package's solver, with their published
stretch at small strain and with that of a woven, 1 kN/m, at least; stock MuJoCo's flex of the same
mesh with the latter, one in finer steps, too; and with the parameters that the benchmark fitted, at
the masses that these have and at a true one. No recording is needed. The same command goes on where
it was stopped, with what it has in `--folder`. `python -m tools.tables` shows docs/rags.json.
"""

import argparse
import dataclasses
import json
import pathlib
from collections.abc import Iterator
from typing import Any

import imageio.v3 as iio
import mujoco
import numpy as np

from benchmarks import stock_flex
from benchmarks.cloth import speed_of_machine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.jobs.files import write_whole
from softgym_mj.jobs.store import JSON, Store
from softgym_mj.reality import primitives, rag_scene
from softgym_mj.reality.pictures import Painter, beside, camera_at
from softgym_mj.reality.rags import FRAME_RATE
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.replay import Hold

GRAMS = (150, 200, 300)  # [g/m^2]
FABRICS = (
    "gray_interlock", "ivory_rib_knit", "pink_ribbon", "white_dots", "navy_sparkle",
    "camel_ponte", "black_denim", "white_swim", "red_jet_set", "royal_target",
)  # fmt: skip
WOVEN = 1000.0  # [N/m] The least stretch of a woven.
STEPS = {"shell_10ms": 0.01, "shell_2ms": 0.002}  # [s] Of stock MuJoCo.
FINELY = ("black_denim",)  # What stock MuJoCo has in fine steps, too.
TRUE_GRAMS = 200  # [g/m^2] That the fits are tried at: a rag of 0.06 kg.

# What the benchmark fitted for its MuJoCo, from its bcm/conf/envs/mujoco3.yaml: mass [kg], Young's
# modulus [Pa], thickness [m], Poisson's ratio, damping of edges.
FITS = {
    ("chequered", "dynamic"): (2.552954, 85242.02, 5.0e-4, 0.403274, 1.0),
    ("cotton", "dynamic"): (4.745227, 84581.53, 8.403439e-4, 0.480505, 0.939347),
    ("linen", "dynamic"): (2.293705, 35080.94, 9.957735e-4, 0.446091, 0.612906),
    ("chequered", "quasi_static"): (11.680963, 40450.80, 9.042039e-4, 0.483287, 0.189585),
    ("cotton", "quasi_static"): (10.644597, 10846.91, 1.238478e-3, 0.414071, 0.692711),
    ("linen", "quasi_static"): (8.231356, 60525.59, 1.190599e-3, 0.429802, 0.458924),
}
# The picture: this package, stock MuJoCo with the fabric's stretch, and as the benchmark fitted it,
# at the fitted and at a true mass.
SHOWN = (
    ("ours_woven", "black_denim", 200, "dynamic"),
    ("shell_10ms", "black_denim", 200, "dynamic"),
    ("fitted", "chequered", 8105, "dynamic"),
    ("fitted", "chequered", 200, "dynamic"),
)
MOMENTS = (0.0, 1.1, 2.0, 2.6, 3.3, 3.8, 4.3)  # [s]
CAMERA = (np.array([1.36, 1.5, 1.0]), np.array([0.259, 0.02, 0.62]))  # [m] Its place, what it sees.
SIZE, FIELD_OF_VIEW = (240, 240), 42.0  # [pixels], [deg]

KEY = ("engine", "fabric", "grams_per_m2", "primitive")

Row = dict[str, Any]


def cases() -> Iterator[tuple[str, str, int, str]]:
    """All runs: engine, fabric, density [g/m^2] and primitive."""
    for engine in ("ours", "ours_woven", "shell_10ms"):
        for fabric in FABRICS:
            for grams in GRAMS:
                for primitive in primitives.PIECES:
                    yield engine, fabric, grams, primitive
    for fabric in FINELY:
        for primitive in primitives.PIECES:
            yield "shell_2ms", fabric, TRUE_GRAMS, primitive
    area = rag_scene.rag().area
    for (rag, primitive), (mass, *_) in FITS.items():
        for grams in (round(1e3 * mass / area), TRUE_GRAMS):
            yield "fitted", rag, grams, primitive


def fabric_of(engine: str, name: str, grams: int) -> Fabric:
    """A named fabric with another density, and the stretch of a woven at least unless as is."""
    found = Fabric.named(name)
    stretch = found.stretch_stiffness if engine == "ours" else max(found.stretch_stiffness, WOVEN)
    return dataclasses.replace(found, density=1e-3 * grams, stretch_stiffness=stretch)


def run(engine: str, name: str, grams: int, primitive: str) -> Row:
    """How a run went."""
    return figures(replayed(engine, name, grams, primitive))


def replayed(engine: str, name: str, grams: int, primitive: str) -> Replay:
    """A run, at the frames of a camera."""
    times = np.arange(0.0, primitives.duration(primitive), 1.0 / FRAME_RATE)
    mesh = rag_scene.rag()
    if engine.startswith("ours"):
        return rag_scene.replay_rag(fabric_of(engine, name, grams), primitive, times)
    if engine == "fitted":
        _, young, thickness, poisson, damping = FITS[name, primitive]
        flex = stock_flex.Flex.published(young, thickness, poisson, damping)
    else:
        fabric = fabric_of(engine, name, grams)
        flex = stock_flex.Flex.shell(
            fabric.stretch_stiffness, fabric.bend_stiffness, fabric.friction, STEPS[engine]
        )
    return stock_flex.replay(
        mesh, flex, 1e-3 * grams * mesh.area,
        Hold(rag_scene.corners(mesh), rag_scene.hands(primitive)), times,
        start=rag_scene.hung(mesh), begin=rag_scene.BEGIN, floor=rag_scene.TABLE,
    )  # fmt: skip


def figures(found: Replay) -> Row:
    """Figures of a run; strain is the 99th percentile of edges, before 0 s and from then on."""
    steps = found.steps
    before = steps.times <= 0.0
    parts = {"settling": steps.strain_99[before], "moving": steps.strain_99[~before]}
    return {
        "failures": [dataclasses.asdict(failure) for failure in found.failures],
        **{f"strain_99_{part}": float(s.max()) if len(s) else None for part, s in parts.items()},
        "strain_max": float(steps.strain_max.max()),
        "lowest_m": found.lowest,
        "milliseconds": found.milliseconds,
        "real_time_factor": found.real_time_factor,
        "step_s": float(np.median(np.diff(steps.times))) if len(steps.times) > 1 else None,
    }


def strip(extension: str) -> bytes:
    """A picture: a row for each of `SHOWN` at some moments of the fling."""
    mesh = rag_scene.rag()
    camera = camera_at(*CAMERA, SIZE, FIELD_OF_VIEW)
    painter = Painter.of(mesh.points, mesh.triangles, camera, SIZE, rag_scene.TABLE)
    held = [*rag_scene.corners(mesh)]
    rows = []
    for key in SHOWN:
        positions = replayed(*key).positions[[round(t * FRAME_RATE) for t in MOMENTS]]
        rows.append(beside([painter.sheet(vertices, vertices[held]) for vertices in positions]))
    return iio.imwrite("<bytes>", np.concatenate(rows), extension=extension)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=pathlib.Path, required=True, help="of what is done")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("docs/rags.json"))
    parser.add_argument("--strip", type=pathlib.Path, help="draw this picture, and nothing else")
    arguments = parser.parse_args()
    if arguments.strip:
        write_whole(arguments.strip, strip(arguments.strip.suffix))
        return
    specification = {
        "mujoco": mujoco.__version__,
        "spacing_m": rag_scene.SPACING,
        "woven_n_per_m": WOVEN,
        "materials": {name: Fabric.named(name).material() for name in FABRICS},
        "steps_s": STEPS,
        "fits": [[*key, *values] for key, values in FITS.items()],
    }
    store = Store(arguments.folder, specification, JSON)
    rows: list[Row] = []

    def keep(key: tuple[str, str, int, str], value: Row) -> None:
        row = dict(zip(KEY, key, strict=True)) | value
        kinds = [failure["kind"] for failure in value["failures"]]
        print(*key, f"{value['milliseconds']:.2f} ms", kinds, flush=True)
        rows.append(row)

    # Long ones last.
    store.run(sorted(cases(), key=lambda case: case[0].startswith("shell")), run, progress=keep)
    order = {case: number for number, case in enumerate(cases())}
    rows.sort(key=lambda row: order[tuple(row[name] for name in KEY)])
    result = {
        **specification,
        "machine": speed_of_machine(),
        "vertices": len(rag_scene.rag().points),
        "runs": rows,
    }
    arguments.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
