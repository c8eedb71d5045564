"""Errors of simulated water, and of other solutions, against recordings."""

import dataclasses
import pathlib
import time
from collections.abc import Iterator, Mapping, Sequence

from softgym_mj.exceptions import check_count, check_name
from softgym_mj.fluid import Liquid
from softgym_mj.reality.water.dam_breaks import DamBreak, Obstacle
from softgym_mj.reality.water.experiments import Error, Experiment
from softgym_mj.reality.water.sloshing import Sloshing, natural_period

# Water at 20 degrees; nothing in it corresponds to Coulomb friction and attraction of particles.
PLAIN = Liquid(viscosity=1e-6, cohesion=0.0, friction=0.0, density=998.0)

_INCH = 0.0254  # [m]
# Series 5: 1.231 times the first natural frequency; times are counted in periods.
_BOUSCASSE = natural_period(1.0, 0.03) / 1.231
EXPERIMENTS: Mapping[str, Experiment] = {
    "koshizuka_oka": DamBreak("ko_data", 0.146, 4.0, lifted=True),
    "koshizuka_oka_sudden": DamBreak(
        "ko_data", 0.146, 4.0, computed=(("MPS of Koshizuka and Oka", "ko_mps_data"),)
    ),
    "koshizuka_oka_mps": DamBreak("ko_mps_data", 0.146, 4.0),  # Their front is the reference.
    "martin_moyce_29": DamBreak("mm_data_1", 1.125 * _INCH, 9.0),
    "martin_moyce_57": DamBreak("mm_data_2", 2.25 * _INCH, 18.0),
    "spheric_2": Obstacle(),
    "faltinsen": Sloshing("faltinsen", 1.73, 0.6, 0.032, 1.3, starts_at_rest=True),
    "bouscasse": Sloshing(
        "bouscasse_5", 1.0, 0.03, 0.07, _BOUSCASSE, starts_at_rest=False, unit=_BOUSCASSE
    ),
}
CELLS: Mapping[str, Sequence[int]] = {  # Particles over the depth of the water at rest.
    "koshizuka_oka": (16, 32),
    "koshizuka_oka_sudden": (16, 32),
    "koshizuka_oka_mps": (16, 32),
    "martin_moyce_29": (16, 32),
    "martin_moyce_57": (16, 32),
    "spheric_2": (10, 20),
    "faltinsen": (12, 24, 32),
    "bouscasse": (4, 6),
}
MOST_CELLS = 100


@dataclasses.dataclass(frozen=True)
class Measurement:
    """Error of a solution of an experiment.

    Attributes:
        experiment: Name, one of `EXPERIMENTS`.
        solution: Name of the liquid, or of the solution by others.
        cells: Particles over the depth of the water at rest; 0 for solutions by others.
        particles: Number of particles.
        error: Difference from the recording.
        seconds: CPU time [s], with the settling of the water.
    """

    experiment: str
    solution: str
    cells: int
    particles: int
    error: Error
    seconds: float


def measure(
    folder: pathlib.Path | None,
    names: Sequence[str],
    liquids: Mapping[str, Liquid],
    cells: Sequence[int] = (),
) -> Iterator[Measurement]:
    """Simulates experiments and compares them with their recordings.

    Args:
        folder: Folder with the files of `recordings.SOURCES`.
        names: Names of `EXPERIMENTS`.
        liquids: Properties of the water, by title.
        cells: Particles over the depth of the water at rest, at most 100; if empty, `CELLS`.

    Raises:
        InvalidArgumentError: For an unknown name, a wrong number, or a missing file.
        StoreError: For a file of another layout.
        SimulationError: If a simulation diverges.
    """
    for name in names:
        check_name("experiment", name, EXPERIMENTS)
    for number in cells:
        check_count("cells", number, 2, MOST_CELLS)
    found = {name: EXPERIMENTS[name].read(folder) for name in names}
    for name, recording in found.items():
        experiment, until = EXPERIMENTS[name], float(recording.times[-1])
        for title, run in experiment.others(folder, until).items():
            for error in experiment.compare(recording, run):
                yield Measurement(name, title, 0, 0, error, 0.0)
        for number in cells or CELLS[name]:
            for title, liquid in liquids.items():
                before = time.thread_time()
                run = experiment.simulate(liquid, experiment.depth / number, until)
                took = time.thread_time() - before
                for error in experiment.compare(recording, run):
                    yield Measurement(name, title, number, run.particles, error, took)
