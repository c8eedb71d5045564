"""`benchmarks.rods` and the tables of docs/reality.md, on results by hand."""

import json

import pytest

from benchmarks import rods
from softgym_mj.exceptions import StoreError
from tools import rod_tables


def result(experiment, solver=rod_tables.OWN, variant="default", **changed):
    """A result as the benchmark writes it, and its variant."""
    return {
        "experiment": experiment, "solver": solver, "outcome": "completed", "missing": [],
        "n_elements": 50, "wall_time": 1.25, "values": {}, "options": {}, "provenance": {},
        "metrics": {}, "observations": {}, "variant": variant, **changed,
    }  # fmt: skip


def test_results_are_collected_in_order_without_their_provenance(tmp_path):
    with pytest.raises(StoreError, match="no results"):
        rods.collect(tmp_path)
    for experiment, variant in (("twist", "default"), ("capstan", "overhang=1.5")):
        folder = tmp_path / experiment / variant / "softgym_mj"
        folder.mkdir(parents=True)
        written = result(experiment)
        del written["variant"]
        (folder / "result.json").write_text(json.dumps(written))
    first, second = rods.collect(tmp_path)
    assert (first["experiment"], first["variant"]) == ("capstan", "overhang=1.5")
    assert second["variant"] == "default" and "provenance" not in second


@pytest.mark.parametrize(
    ("experiment", "variant", "metrics", "passed"),
    [
        ("twist", "default", {"critical_twist_error": 0.049}, True),
        ("twist", "default", {"critical_twist_error": 0.051}, False),
        ("twist", "default", {"critical_twist_error": None}, False),
        ("pendulum", "default", {"period_error": 0.01, "amplitude_change": -0.06}, False),
        ("capstan", "overhang=0.95", {"slide": 0.0009}, True),
        ("capstan", "overhang=0.95", {"slide": 0.0011}, False),
        ("capstan", "overhang=1.1", {"slide": 0.0009}, False),
        ("capstan", "overhang=1.1", {"slide": 0.2}, True),
    ],
)
def test_figures_beyond_their_bounds_fail(experiment, variant, metrics, passed):
    found = result(experiment, variant=variant, metrics=metrics)
    assert rod_tables.passes(found) == passed
    assert not rod_tables.passes(found | {"outcome": "diverged"})
    assert ("**" in rod_tables.figures(found)) == (not passed)


def test_unsupported_experiments_name_what_is_missing():
    found = result("capstan", outcome="unsupported", missing=["cylinder_contact"])
    assert rod_tables.figures(found) == "unsupported: cylinder_contact"
    assert not rod_tables.passes(found)
