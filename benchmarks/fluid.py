"""CPU time of a step of water, at rest and shaken: SIMD kernels, portable ones, warp's SPH example.

    pip install --editable '.[bench]'    # With warp; without it, its columns are left out.
    OMP_NUM_THREADS=1 python -m benchmarks.fluid --out docs/fluid.json

Water stands in a cup until it rests. It is timed at rest, and while the cup is moved by a square
wave along both axes, with reversals and stops. In a round, every stretch of that motion is played
from the same state by the SIMD kernels and by the scalar ones (the same code for any processor) in
turn; figures are medians over rounds. They are CPU times of the calling thread for all of `mj_step`
(and the few microseconds of the loop around it), over the substeps that the plugin chooses by
itself.

The peer is `warp.examples.core.example_sph` of NVIDIA's warp, on the CPU. A substep builds a hash
grid, then runs the kernels for density, acceleration, bounds and integration, with our ratio of
support to spacing, number of substeps and particles: those of the stretch just played, which stay
there because its time step is 0. This compares what it costs that each particle visits its
neighbors twice, including how they are found. It does not compare physics or accuracy: the example
is a weakly compressible scheme without walls (it clamps coordinates), and which substep it would
need for the same water is left open. `warp_process_over_thread`, the CPU time of the process over
that of the calling thread, is 1 if warp has no threads of its own.
"""

import argparse
import contextlib
import itertools
import json
import math
import os
import pathlib
import statistics
import time
from collections.abc import Iterator, Sequence
from types import ModuleType

import mujoco
import numpy as np

from benchmarks.machine import machine, yardstick
from tests.scenes.fluid_cup import SPACING, FluidCup

# Particles along X, Y and Z. The last are 8788, the most that SoftGym draws.
COLUMNS = ((10, 10, 5), (8, 8, 18), (10, 10, 20), (13, 13, 24), (13, 13, 52))
TIMESTEP = 0.01  # [s]
HEIGHT = 12.0  # [m] Height of the cup: nothing overtops it.
SETTLING = 300  # Steps, 3 s.
DWELL = 37  # Steps in a stretch: 0.24 m at full speed.
SPEED = 0.66  # [m/s] Speed of the shaken cup.
REST = np.zeros((3, 3))  # Velocities of the cup [m/s], one row a stretch.
SHAKEN = SPEED * np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 0]], float
)
MOTIONS = {"rest": REST, "shaken": SHAKEN}

SUPPORT = 1.83  # Radius of the plugin's kernel over the spacing.
KERNELS_VARIABLE = "SOFTGYM_MJ_SIMD"  # The plugin reads it in every step.
KERNELS = ("scalar", "simd")  # The motion goes on from where the last leaves it.
PEER = "warp"

# The example's own, in SI units for water; they do not change what it costs.
STIFFNESS = 20.0  # Pressure per density [m^2/s^2].
DENSITY = 1000.0  # [kg/m^3]
VISCOSITY = 0.025  # [Pa s]
DAMPING = -0.95  # Share of the velocity after a clamp.

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Stopwatch:
    """Adds up CPU time [s] of the calling thread and of the process, and the steps it took."""

    def __init__(self):
        self.thread = self.process = 0.0
        self.steps = 0

    @contextlib.contextmanager
    def running(self, steps: int) -> Iterator[None]:
        thread, process = time.thread_time(), time.process_time()
        yield
        self.thread += time.thread_time() - thread
        self.process += time.process_time() - process
        self.steps += steps


class WarpExample:
    """The kernels of warp's SPH example, on particles that stay where they are placed.

    Commands are recorded once, so that the example's launches from Python do not count against it.
    """

    def __init__(self, example: ModuleType, cup: FluidCup, layers: int):
        """Compiles the kernels, unless they are in warp's cache.

        Args:
            example: warp's module.
            cup: the water.
            layers: how deep it is [particles].
        """
        import warp

        count, radius = cup.count, SUPPORT * SPACING
        with warp.ScopedDevice("cpu"):
            sizes = np.array([cup.length, cup.width, layers * SPACING])
            self._grid = warp.HashGrid(*(np.ceil(sizes / radius).astype(int) + 1).tolist())
            self._radius = radius
            self._positions = warp.zeros(count, dtype=warp.vec3)
            velocities, accelerations = (warp.zeros(count, dtype=warp.vec3) for _ in range(2))
            densities = warp.zeros(count, dtype=float)
            # The norms of the kernels, as in the example.
            mass = DENSITY * SPACING**3
            norm = 45.0 * mass / (math.pi * radius**6)
            arguments = {
                example.compute_density: [
                    self._grid.id, self._positions, densities,
                    315.0 * mass / (64.0 * math.pi * radius**9), radius,
                ],
                example.get_acceleration: [
                    self._grid.id, self._positions, velocities, densities, accelerations,
                    STIFFNESS, DENSITY, -9.81, -norm, VISCOSITY * norm, radius,
                ],
                example.apply_bounds: [
                    self._positions, velocities, DAMPING, HEIGHT, HEIGHT, HEIGHT,
                ],
                example.kick: [velocities, accelerations, 0.0],
                example.drift: [self._positions, velocities, 0.0],
            }  # fmt: skip
            self._commands = [
                warp.launch(kernel, dim=count, inputs=inputs, record_cmd=True)
                for kernel, inputs in arguments.items()
            ]
        self.place(cup.positions)
        self.step(1)

    def place(self, positions: np.ndarray) -> None:
        """Puts the particles at positions (count, 3) [m], moved into the example's bounds."""
        self._positions.assign(positions - positions.min(axis=0))

    def step(self, substeps: int) -> None:
        for _ in range(substeps):
            self._grid.build(self._positions, self._radius)
            for command in self._commands:
                command.launch()


def chosen_substeps(columns: tuple[int, int], layers: int) -> int:
    """Substeps that the plugin takes by itself: the number that, when set, gives the same bits."""

    def after_a_step(**config) -> np.ndarray:
        cup = FluidCup(columns, layers, height=HEIGHT, timestep=TIMESTEP, **config)
        cup.step()
        return cup.positions.copy()

    chosen = after_a_step()
    return next(n for n in itertools.count(1) if np.array_equal(after_a_step(substeps=n), chosen))


def drive(cup: FluidCup, velocity: np.ndarray) -> None:
    """Moves the cup at a velocity [m/s] for one stretch."""
    for _ in range(DWELL):
        cup.data.mocap_pos[0] += TIMESTEP * velocity
        cup.step()


def play(
    cup: FluidCup, velocities: np.ndarray, substeps: int, peer: WarpExample | None
) -> dict[str, Stopwatch]:
    """One round: the time that each of `KERNELS` takes for a motion, and that of the peer."""
    watches = {name: Stopwatch() for name in (*KERNELS, *([PEER] if peer else []))}
    state = np.empty(mujoco.mj_stateSize(cup.model, _STATE))
    for velocity in velocities:
        mujoco.mj_getState(cup.model, cup.data, state, _STATE)
        for kernels in KERNELS:
            mujoco.mj_setState(cup.model, cup.data, state, _STATE)
            os.environ[KERNELS_VARIABLE] = kernels
            with watches[kernels].running(DWELL):
                drive(cup, velocity)
        if peer:
            peer.place(cup.positions)
            with watches[PEER].running(1):
                peer.step(substeps)
    return watches


def figures(watches: dict[str, Stopwatch], particle_substeps: int) -> dict[str, float]:
    """Costs and their ratios, given the number of particles times that of substeps in a step."""
    seconds = {name: watch.thread / watch.steps for name, watch in watches.items()}
    result = {}
    for name, step in seconds.items():
        result[f"{name}_ns_per_particle_substep"] = 1e9 * step / particle_substeps
        result[f"{name}_ms_per_step"] = 1e3 * step
        result[f"{name}_steps_per_second"] = 1.0 / step
    result["scalar_over_simd"] = seconds["scalar"] / seconds["simd"]
    if PEER in seconds:
        result["warp_over_simd"] = seconds[PEER] / seconds["simd"]
        result["warp_process_over_thread"] = watches[PEER].process / watches[PEER].thread
    return result


def medians(rounds: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: statistics.median(one[name] for one in rounds) for name in rounds[0]}


def measure(
    shape: tuple[int, int, int], repeats: int, example: ModuleType | None
) -> dict[str, dict[str, float]]:
    """All figures of one column of water, by motion."""
    columns, layers = shape[:2], shape[2]
    substeps = chosen_substeps(columns, layers)
    cup = FluidCup(columns, layers, height=HEIGHT, timestep=TIMESTEP)
    cup.step(SETTLING)
    peer = WarpExample(example, cup, layers) if example else None
    results = {}
    for motion, velocities in MOTIONS.items():
        for velocity in velocities:  # Once ahead: the first stretch starts from rest.
            drive(cup, velocity)
        rounds = [play(cup, velocities, substeps, peer) for _ in range(repeats)]
        costs = medians([figures(one, cup.count * substeps) for one in rounds])
        results[motion] = {"substeps": substeps, **costs}
    return results


def load_example() -> ModuleType | None:
    """Warp's example; None, with a message, if it cannot be imported."""
    try:
        import warp
        from warp.examples.core import example_sph
    except ImportError as error:
        print(f"No comparison with warp ({error}). To have it: pip install --editable '.[bench]'")
        return None
    warp.init()  # Says what it found, before the table starts.
    return example_sph


def row(count: int, motion: str, costs: dict[str, float]) -> str:
    """A line of the table."""
    text = f"{count:5} x {costs['substeps']:2} {motion:7}"
    text += f"{costs['simd_ms_per_step']:8.2f} ms {costs['simd_steps_per_second']:7.0f} /s"
    for name in ("simd", "scalar", PEER):
        if f"{name}_over_simd" in costs or name == "simd":
            text += f"   {name} {costs[f'{name}_ns_per_particle_substep']:6.1f} ns"
        if f"{name}_over_simd" in costs:
            text += f" ({costs[f'{name}_over_simd']:4.1f} x)"
    return text


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--repeats", type=int, default=5, help="rounds of which medians are taken")
    arguments = parser.parse_args()
    example = load_example()
    print("particles x substeps; a step with the SIMD kernels; cost per particle and substep")
    results = {}
    for shape in COLUMNS:
        count = math.prod(shape)
        results[count] = measure(shape, arguments.repeats, example)
        for motion, costs in results[count].items():
            print(row(count, motion, costs), flush=True)
    if arguments.out:
        where = {
            **machine(), "mujoco": mujoco.__version__, "humanoid_mj_steps_per_second": yardstick()
        }  # fmt: skip
        result = {"machine": where, "columns": results}
        arguments.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
