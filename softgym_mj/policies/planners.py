"""Sampling-based planners: the paper's cross-entropy method (CEM), and iCEM.

Both search for the action sequence with the highest return. The caller computes returns, so
planners do not depend on an environment.
"""

import dataclasses
from collections.abc import Generator

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.registry import find
from softgym_mj.validation import as_array

BUDGET = 21_000  # Env steps per decision, over all iterations (paper).
MOST_BUDGET = 10_000_000  # A population of this size needs 1 GiB.
ITERATIONS = 10  # Iterations per decision (paper).
ELITES = 0.1  # Fraction of a population that the next distribution is fitted to (paper).
MIN_POPULATION = 10  # Smaller populations have no elite.
VARIANCE = 0.5  # Initial variance, a quarter of the range of actions (authors' code).
# The authors' code lets the variance collapse. This one keeps a standard deviation of 0.05: the
# variance of a single elite, of a population of 10, is 0.
VARIANCE_FLOOR = 0.05**2
# iCEM (Pinneri et al. 2020): exponent of the power spectrum of its noise, by which neighboring
# actions are alike; fraction of the elites that go on to the next iteration.
COLOR, KEPT = 2.5, 0.3

# Yields action sequences (n, horizon, size) and is sent their returns (n,).
Search = Generator[np.ndarray, np.ndarray, "Plan"]


@dataclasses.dataclass(frozen=True)
class Plan:
    """Result of a planner.

    Attributes:
        actions: Action sequence (horizon, size) in [-1, 1].
        best_return: Highest return of all samples.
        env_steps: Env steps that were simulated.
    """

    actions: np.ndarray
    best_return: float
    env_steps: int


class CEM:
    """Cross-entropy method of the paper: fits a diagonal Gaussian to the best action sequences.

    Samples are independent over time; the last mean is executed.
    """

    def __init__(self, horizon: int, budget: int = BUDGET, iterations: int = ITERATIONS):
        """Splits the simulated env steps of a decision evenly over the iterations.

        Raises:
            InvalidArgumentError: if the budget has fewer than 10 sequences per iteration.
        """
        check_count("horizon", horizon, 1)
        check_count("iterations", iterations, 1)
        check_count("budget", budget, 1, MOST_BUDGET)
        self.horizon, self.iterations = horizon, iterations
        self.population = budget // iterations // horizon
        if self.population < MIN_POPULATION:
            least = MIN_POPULATION * iterations * horizon
            raise InvalidArgumentError(
                "budget",
                budget,
                f"{least} env steps or more for a planning horizon of {horizon} and {iterations} "
                "iterations; fewer with fewer iterations or a shorter horizon",
            )

    def first_guess(self, size: int) -> np.ndarray:
        """Returns the initial mean (horizon, size) of an episode's first decision."""
        return np.zeros((self.horizon, size))

    def shifted(self, actions: np.ndarray, steps: int) -> np.ndarray:
        """Returns the initial mean (horizon, size) after `steps` of a plan have been executed.

        The remaining actions are followed by zeros (authors' code).
        """
        rest = actions[steps:]
        return np.concatenate([rest, np.zeros((self.horizon - len(rest), actions.shape[1]))])

    def search(self, guess: np.ndarray, random: np.random.Generator) -> Search:
        """Searches for the best sequence; yields each population and is sent its returns.

        The first population has the mean `guess` (horizon, size).

        Raises:
            InvalidArgumentError: for another number of returns, or NaN.
        """
        mean, variance = guess, np.full_like(guess, VARIANCE)
        best, best_return, steps = guess, -np.inf, 0
        kept_elites = np.empty((0, *guess.shape))
        count = max(1, int(ELITES * self.population))
        for iteration in range(self.iterations):
            noise = self._noise((self.population - len(kept_elites), *guess.shape), random)
            samples = np.clip(mean + np.sqrt(variance) * noise, -1.0, 1.0)
            samples = self._population(samples, kept_elites, mean, iteration)
            returns = as_array("returns", (yield samples), (len(samples),))
            if np.isnan(returns).any():
                raise InvalidArgumentError("returns", returns, "numbers that are not NaN")
            steps += samples.shape[0] * self.horizon
            # A stable sort of the negated returns: the first of equals is the better one.
            elites = samples[np.argsort(-returns, kind="stable")[:count]]
            if returns.max() > best_return:
                best, best_return = elites[0], float(returns.max())
            mean, variance = elites.mean(axis=0), np.maximum(elites.var(axis=0), VARIANCE_FLOOR)
            kept_elites = self._kept_elites(elites)
        return Plan(self._chosen(mean, best), best_return, steps)

    def _noise(self, shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
        """Returns standard normal entries (n, horizon, size)."""
        return random.standard_normal(shape)

    def _population(
        self, samples: np.ndarray, kept_elites: np.ndarray, mean: np.ndarray, iteration: int
    ) -> np.ndarray:
        """Returns the population of an iteration."""
        return samples

    def _kept_elites(self, elites: np.ndarray) -> np.ndarray:
        """Returns the elites that are added to the next population."""
        return elites[:0]

    def _chosen(self, mean: np.ndarray, best: np.ndarray) -> np.ndarray:
        """Returns the sequence that is executed."""
        return mean


class ICEM(CEM):
    """iCEM (Pinneri et al. 2020): colored noise, reused elites, and the best sample is executed."""

    def _noise(self, shape, random):
        return colored_noise(shape, random)

    def _population(self, samples, kept_elites, mean, iteration):
        samples = np.concatenate([kept_elites, samples])
        if iteration == self.iterations - 1:
            samples[-1] = mean
        return samples

    def _kept_elites(self, elites):
        return elites[: max(1, int(KEPT * len(elites)))]

    def _chosen(self, mean, best):
        return best


PLANNERS = {"cem": CEM, "icem": ICEM}


def make_planner(
    name: str,
    task: str,
    horizon: int | None = None,
    budget: int = BUDGET,
    iterations: int = ITERATIONS,
) -> CEM:
    """Returns a planner by name, with the settings of `CEM`; its horizon is the task's by default.

    Raises:
        InvalidArgumentError: for an unknown planner or an invalid setting.
    """
    check_name("planner", name, PLANNERS)
    usual = find(task).resolve().planning_horizon
    return PLANNERS[name](usual if horizon is None else horizon, budget, iterations)


def colored_noise(shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    """Returns normal noise (n, horizon, size) of unit variance with power spectrum 1 / f^COLOR.

    The method is that of Timmer and Koenig (1995): each frequency has a normal complex amplitude.
    """
    number, horizon, size = shape
    if horizon == 1:
        return random.standard_normal(shape)
    frequencies = np.fft.rfftfreq(horizon)
    frequencies[0] = frequencies[1]  # The mean has the amplitude of the lowest frequency.
    scale = frequencies ** (-COLOR / 2)
    real = random.standard_normal((number, size, len(frequencies))) * scale
    imaginary = random.standard_normal((number, size, len(frequencies))) * scale
    imaginary[..., 0] = 0.0
    real[..., 0] *= np.sqrt(2)
    # Variance of the real signal: the constant part and, of even lengths, the highest frequency
    # have no phase and count half as much as the other waves.
    power = scale[0] ** 2 + 2.0 * np.sum(scale[1:] ** 2)
    if horizon % 2 == 0:
        imaginary[..., -1] = 0.0
        real[..., -1] *= np.sqrt(2)
        power -= scale[-1] ** 2
    waves = np.fft.irfft(real + 1j * imaginary, n=horizon, axis=-1)
    return np.swapaxes(waves, 1, 2) * (horizon / np.sqrt(2.0 * power))
