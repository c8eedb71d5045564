"""`Scenario`: what is done to a cable; baselines."""

import dataclasses

import numpy as np

from softgym_mj.reality.rope.recordings import HELD, Recording

START_FRAMES = 2  # Frames that a solver sees: they define position and velocity.


@dataclasses.dataclass(frozen=True)
class Scenario:
    """Start of a cable's motion, and the paths of the markers that are held.

    Attributes:
        start: (2, n, 3) [m] all markers in the first two frames.
        held: (f, 4, 3) [m] the first two and the last two markers in the following frames.
    """

    start: np.ndarray
    held: np.ndarray


def scenario_of(recording: Recording) -> Scenario:
    """Returns the scenario of a recording."""
    markers = recording.markers
    return Scenario(markers[:START_FRAMES], markers[START_FRAMES:, HELD])


class NothingMoves:
    """Baseline: free markers stay where they started."""

    name = "nothing moves"
    models: tuple[str, ...] = ()

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns markers (f, n, 3) [m], the free ones at rest."""
        markers = np.repeat(scenario.start[-1:], len(scenario.held), axis=0)
        markers[:, HELD] = scenario.held
        return markers


class EndsInterpolated:
    """Baseline: a marker moves like both ends of the cable, weighted by its number among them."""

    name = "displacement of the ends, interpolated"
    models: tuple[str, ...] = ()

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns markers (f, n, 3) [m], the free ones moved like the ends."""
        start = scenario.start[-1]
        share = np.linspace(0.0, 1.0, len(start))[:, None]
        first, last = (scenario.held[:, None, i] - start[i] for i in (0, -1))
        markers = start + (1.0 - share) * first + share * last
        markers[:, HELD] = scenario.held
        return markers
