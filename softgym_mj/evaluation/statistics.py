"""Statistics of the scores of an evaluation, with bootstrap confidence intervals."""

from collections.abc import Mapping, Sequence

import numpy as np

RESAMPLES = 10_000  # Moves the ends of an interval by less than a hundredth of its width.
LEVEL = 0.95  # Confidence level of intervals.
_CUT = 0.25  # Share of the scores that the interquartile mean leaves out at either end.
_SEED = 0x424F4F54  # Fixed, so that the same scores have the same interval.
_AT_ONCE = 1_000  # Number of resamples in memory at a time.


def summary(episodes: Sequence[Mapping]) -> dict[str, float]:
    """Returns summary statistics of an evaluation; `methods` describes them.

    Median and quartiles are over seeds (of means over variations, as in the paper), or over
    variations if there is one seed; mean and interquartile mean are over all episodes, with
    bootstrap intervals as in rliable (Agarwal et al. 2021).
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
        "iqm": float(_interquartile_means(scores.ravel())),
        "iqm_low": iqm_low,
        "iqm_high": iqm_high,
        "min": float(scores.min()),
        "max": float(scores.max()),
        "success_rate": float(np.mean([episode["success"] for episode in episodes])),
    }


def secondary_metrics(episodes: Sequence[Mapping]) -> dict[str, float]:
    """Returns means over all episodes of the secondary metrics at the last step, by name."""
    return {
        name: float(np.mean([episode["secondary_metrics"][name] for episode in episodes]))
        for name in episodes[0]["secondary_metrics"]
    }


def methods(episodes: Sequence[Mapping]) -> dict[str, str]:
    """Returns descriptions of the numbers of `summary`."""
    return {
        "score": "normalized performance at the last step",
        "quartiles": f"over {quartiles_over(episodes)}",
        "iqm": "mean of the middle half of all episodes",
        "low_high": f"{LEVEL:.0%} bootstrap interval, percentiles of {RESAMPLES} resamples of "
        "seeds and of variations",
    }


def quartiles_over(episodes: Sequence[Mapping]) -> str:
    """Returns what median and quartiles are over: "seeds", or "variations" with one seed."""
    return "seeds" if len({episode["seed"] for episode in episodes}) > 1 else "variations"


def _intervals(scores: np.ndarray) -> list[float]:
    """Returns bootstrap intervals of the mean and interquartile mean of scores (seeds, variations).

    Seeds and variations are resampled independently (pigeonhole bootstrap, Owen 2007).
    """
    random, (seeds, variations) = np.random.default_rng(_SEED), scores.shape
    result = []
    for _ in range(RESAMPLES // _AT_ONCE):
        rows = random.integers(seeds, size=(_AT_ONCE, seeds, 1))
        columns = random.integers(variations, size=(_AT_ONCE, 1, variations))
        drawn = scores[rows, columns].reshape(_AT_ONCE, -1)
        result.append((drawn.mean(1), _interquartile_means(drawn)))
    ends = [50 * (1 - LEVEL), 50 * (1 + LEVEL)]
    return np.percentile(np.concatenate(result, axis=1), ends, axis=1).T.ravel().tolist()


def _interquartile_means(scores: np.ndarray) -> np.ndarray:
    """Returns the means of the middle halves of rows of scores (..., n): (...).

    As `scipy.stats.trim_mean`, without its import, which takes half a second.
    """
    size = scores.shape[-1]
    cut = int(_CUT * size)
    parted = np.partition(scores, (cut, size - cut - 1), axis=-1)
    return parted[..., cut : size - cut].mean(-1)
