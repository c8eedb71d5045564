"""Numbers for a table: of the scores of an evaluation's episodes, with their uncertainty."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

RESAMPLES = 10_000  # Moves the ends of an interval by less than a hundredth of its width.
LEVEL = 0.95  # Of intervals.
_CUT = 0.25  # Share of the scores that the interquartile mean leaves out at either end.
_SEED = 0x424F4F54  # The same scores have the same interval.
_AT_ONCE = 1_000  # Resamples in memory.


def summary(episodes: Sequence[Mapping]) -> dict[str, float]:
    """The numbers of an evaluation; `methods` says what they are.

    Args:
        episodes: an episode of every seed in every variation, with "seed", "variation",
            "normalized_performance" and "success".

    Returns:
        Median and quartiles, as in the paper over seeds (of the means over variations); with one
        seed over variations. Mean and interquartile mean over all episodes, as in rliable
        (Agarwal et al. 2021), with the ends of their bootstrap intervals; the least and the
        largest score, and the share of successes.
    """
    result = {(e["seed"], e["variation"]): e["normalized_performance"] for e in episodes}
    seeds, variations = (list(dict.fromkeys(names)) for names in zip(*result, strict=True))
    scores = np.array([[result[seed, variation] for variation in variations] for seed in seeds])
    spread = scores.mean(1) if len(seeds) > 1 else scores[0]
    low, median, high = np.percentile(spread, [25, 50, 75]).tolist()
    mean_low, mean_high, iqm_low, iqm_high = _intervals(scores)
    return {
        "median": median,
        "percentile_25": low,
        "percentile_75": high,
        "mean": float(scores.mean()),
        "mean_low": mean_low,
        "mean_high": mean_high,
        "iqm": float(stats.trim_mean(scores, _CUT, axis=None)),
        "iqm_low": iqm_low,
        "iqm_high": iqm_high,
        "min": float(scores.min()),
        "max": float(scores.max()),
        "success_rate": float(np.mean([episode["success"] for episode in episodes])),
    }


def secondary_metrics(episodes: Sequence[Mapping]) -> dict[str, float]:
    """Means over all episodes of the tasks' secondary metrics at the last step, by name."""
    return {
        name: float(np.mean([episode["secondary_metrics"][name] for episode in episodes]))
        for name in episodes[0]["secondary_metrics"]
    }


def methods(episodes: Sequence[Mapping]) -> dict[str, str]:
    """What the numbers of `summary` are, in words."""
    return {
        "score": "normalized performance at the last step",
        "quartiles": f"over {quartiles_over(episodes)}",
        "iqm": "mean of the middle half of all episodes",
        "low_high": f"{LEVEL:.0%} bootstrap interval, percentiles of {RESAMPLES} resamples of "
        "seeds and of variations",
    }


def quartiles_over(episodes: Sequence[Mapping]) -> str:
    """What median and quartiles are over: "seeds", or "variations" where there is one seed."""
    return "seeds" if len({episode["seed"] for episode in episodes}) > 1 else "variations"


def _intervals(scores: np.ndarray) -> list[float]:
    """Low and high ends for the mean, then for the interquartile mean, of scores (n, m).

    Seeds and variations are drawn apart from each other, with replacement: another evaluation
    would differ in both (the pigeonhole bootstrap, Owen 2007). With one seed, variations differ.
    """
    random, (seeds, variations) = np.random.default_rng(_SEED), scores.shape
    result = []
    for _ in range(RESAMPLES // _AT_ONCE):
        rows = random.integers(seeds, size=(_AT_ONCE, seeds, 1))
        columns = random.integers(variations, size=(_AT_ONCE, 1, variations))
        drawn = scores[rows, columns].reshape(_AT_ONCE, -1)
        result.append((drawn.mean(1), stats.trim_mean(drawn, _CUT, axis=1)))
    ends = [50 * (1 - LEVEL), 50 * (1 + LEVEL)]
    return np.percentile(np.concatenate(result, axis=1), ends, axis=1).T.ravel().tolist()
