"""Runs the simulations of recordings and compares them."""

import pathlib
from collections.abc import Iterator, Sequence

from softgym_mj.reality.water import dam_break, sloshing, spheric
from softgym_mj.reality.water.recordings import DAM_BREAKS, SLOSHING, read_heights, read_table
from softgym_mj.reality.water.settings import SETTINGS, Measurement

# Particles over the depth at rest, of two resolutions.
LAYERS = {"dam_break": (32, 48), "spheric": (13, 18), "faltinsen": (16, 24), "bouscasse": (4, 5)}
EXPERIMENTS = tuple(LAYERS)
RESOLUTIONS = ("coarse", "fine")
_BEYOND = 1.06  # Sloshing is simulated beyond the recording, for periods that are too long.
_MOTIONS = dict(zip(("faltinsen", "bouscasse"), sloshing.MOTIONS, strict=True))


def run(
    folder: pathlib.Path | None, experiments: Sequence[str], resolutions: Sequence[str]
) -> Iterator[Measurement]:
    """Yields the errors of all settings on experiments of `EXPERIMENTS`.

    Raises:
        InvalidArgumentError: If the folder lacks a file.
        StoreError: If a file has another layout.
        SimulationError: If a simulation diverges.
    """
    indices = [RESOLUTIONS.index(resolution) for resolution in resolutions]
    for name in experiments:
        for layers in (LAYERS[name][i] for i in indices):
            if name == "dam_break":
                yield from _dam_breaks(folder, layers)
            elif name == "spheric":
                yield from _spheric(folder, layers)
            else:
                yield from _sloshing(folder, _MOTIONS[name], layers)


def _dam_breaks(folder: pathlib.Path | None, layers: int) -> Iterator[Measurement]:
    recorded = {c.name: read_table(folder, DAM_BREAKS, c.table) for c in dam_break.COLUMNS}
    for column in dam_break.COLUMNS:
        own = recorded[column.name]
        for setting, parameters in SETTINGS.items():
            simulated, count = dam_break.simulate(column, parameters, layers, own.times[-1])
            here = setting, layers, count
            error = dam_break.error(simulated, own)
            yield Measurement(column.name, "front", *here, error, dam_break.BOUND)
            delay = dam_break.best_delay(simulated, own)
            late, seconds = dam_break.error(simulated, own, delay), delay * column.time_unit
            yield Measurement(column.name, "front, delayed", *here, late, None, seconds)


def _spheric(folder: pathlib.Path | None, layers: int) -> Iterator[Measurement]:
    recorded = read_heights(folder)
    for setting, parameters in SETTINGS.items():
        simulated, count = spheric.simulate(parameters, layers)
        for gauge, (ours, theirs) in enumerate(zip(simulated, recorded, strict=True), 1):
            here = spheric.NAME, f"height at H{gauge}", setting, layers, count
            yield Measurement(*here, spheric.error(ours, theirs), spheric.BOUND)


def _sloshing(
    folder: pathlib.Path | None, motion: sloshing.Motion, layers: int
) -> Iterator[Measurement]:
    own = read_table(folder, SLOSHING, motion.table)
    for setting, parameters in SETTINGS.items():
        end = _BEYOND * own.times[-1]
        simulated, count = sloshing.simulate(motion, parameters, layers, end)
        period, amplitude, rest = sloshing.compare(simulated, own)
        here = setting, layers, count
        yield Measurement(motion.name, "period", *here, period, sloshing.PERIOD_BOUND)
        yield Measurement(motion.name, "amplitude", *here, amplitude, sloshing.AMPLITUDE_BOUND)
        yield Measurement(motion.name, "rest", *here, rest, None)
