"""Numbers of an evaluation: by hand, against SciPy, against the variance of the mean."""

import numpy as np
import pytest
from scipy import stats

from softgym_mj.evaluation import statistics
from softgym_mj.evaluation.statistics import methods, summary


def episodes(scores):
    """Episodes of scores (seeds, variations), in an order of their own."""
    result = [
        {"seed": s, "variation": v, "normalized_performance": score, "success": score > 0.9}
        for s, row in enumerate(scores)
        for v, score in enumerate(row)
    ]
    return result[::-1]


def test_the_summary_by_hand():
    result = summary(episodes([(0.0, 0.4), (0.6, 1.0), (0.5, 0.5), (-1.0, 0.0)]))
    # Means of the seeds: 0.2, 0.8, 0.5, -0.5; the middle half: 0, 0.4, 0.5, 0.5.
    expected = {"median": 0.35, "percentile_25": 0.025, "percentile_75": 0.575, "mean": 0.25,
                "iqm": 0.35, "min": -1.0, "max": 1.0, "success_rate": 0.125}  # fmt: skip
    assert {name: result[name] for name in expected} == pytest.approx(expected)


def test_quartiles_of_one_seed_are_over_variations():
    one = episodes([(0.0, 0.1, 0.2, 0.6, 1.0)])
    result = summary(one)
    assert [result[n] for n in ("percentile_25", "median", "percentile_75")] == [0.1, 0.2, 0.6]
    assert methods(one)["quartiles"] == "over variations"
    assert methods(episodes([(0.0,), (1.0,)]))["quartiles"] == "over seeds"


def test_the_intervals_of_one_seed_are_those_of_scipy():
    scores = np.random.default_rng(0).gamma(2.0, 0.2, 40)
    result = summary(episodes([scores]))
    middle = lambda samples, axis: stats.trim_mean(samples, 0.25, axis=axis)  # noqa: E731
    for name, function in (("mean", np.mean), ("iqm", middle)):
        interval = stats.bootstrap(
            (scores,), function, method="percentile", n_resamples=20_000, rng=1
        ).confidence_interval
        own = result[f"{name}_low"], result[f"{name}_high"]
        # Both ends are drawn: they scatter by a hundredth of the width.
        assert own == pytest.approx(interval, abs=0.04 * (interval.high - interval.low))


def test_the_interval_has_the_scatter_of_seeds_and_of_variations():
    random = np.random.default_rng(0)
    seeds, variations = random.normal(0.0, 0.2, 30), random.normal(0.5, 0.1, 50)
    result = summary(episodes(seeds[:, None] + variations))
    # What both add to the mean is normal, with these variances.
    deviation = np.sqrt(np.var(seeds) / 30 + np.var(variations) / 50)
    width = result["mean_high"] - result["mean_low"]
    assert width == pytest.approx(2 * stats.norm.ppf(0.975) * deviation, rel=0.04)
    assert summary(episodes(seeds[:, None] + variations)) == result


@pytest.mark.slow
@pytest.mark.parametrize(("seeds", "share"), [(2, 0.56), (3, 0.76), (5, 0.85), (10, 0.91)])
def test_how_often_intervals_hold_the_true_mean(seeds, share, monkeypatch):
    """The shares of docs/evaluation.md: seeds scatter four times as much as variations."""
    monkeypatch.setattr(statistics, "RESAMPLES", 2_000)
    random, trials, held = np.random.default_rng(seeds), 400, 0
    for _ in range(trials):
        scores = random.normal(0.7, 0.2, (seeds, 1)) + random.normal(0.0, 0.05, 20)
        result = summary(episodes(scores + random.normal(0.0, 0.05, scores.shape)))
        held += result["mean_low"] <= 0.7 <= result["mean_high"]
    assert held / trials == pytest.approx(share, abs=0.05)  # Two deviations, at most.
