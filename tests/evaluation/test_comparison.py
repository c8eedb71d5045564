"""Results beside each other: names, tables, figures."""

import csv

import numpy as np
import pytest

from softgym_mj.evaluation import Configuration, comparison, evaluate, plots
from softgym_mj.evaluation.indices import as_text, parsed
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.storage.files import write_csv, write_json
from tests.command import output_of


def written(folder, **changes):
    """A result file with some of its entries changed."""
    configuration = Configuration("straighten_rope", "zero", (800, 801), (0,), {"horizon": 2})
    write_json(folder / "result.json", {**evaluate(configuration, folder), **changes})
    return folder


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """Results of a policy and of a planner with two horizons."""
    folder = tmp_path_factory.mktemp("results")
    return [
        written(folder / "zero"),
        written(folder / "long", policy="cem", planning={"horizon": 15, "budget": 1}),
        written(folder / "short", policy="cem", planning={"horizon": 5, "budget": 1}),
    ]


def test_labels_tell_results_of_a_task_apart(three):
    read = comparison.read_results(three)
    assert comparison.labels(read) == ["zero", "cem horizon=15", "cem horizon=5"]
    episodes = read[0]["episodes"]
    more = {**read[0], "seeds": [0, 1, 2, 5], "variations": [801, 802]}
    other_task = {**read[0], "task": "fold_cloth", "variations": [805]}
    assert comparison.labels([read[0], more, other_task]) == [
        "zero variations=800-801 seeds=0",
        "zero variations=801-802 seeds=0-2,5",
        "zero",
    ]
    assert comparison.read_results([three[0], three[0] / "result.json"]) == [read[0]]
    changed = {**read[0], "episodes": episodes[::-1]}
    with pytest.raises(StoreError, match="'zero' on straighten_rope have the same settings"):
        comparison.labels([read[0], changed])


def test_a_table_has_what_the_results_have(tmp_path, three):
    rows = comparison.rows(comparison.read_results(three))
    write_csv(tmp_path / "table.csv", list(rows[0]), rows)
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert [row["policy"] for row in rows] == ["zero", "cem horizon=15", "cem horizon=5"]
    read = comparison.read_results(three[:1])
    scores = [episode["normalized_performance"] for episode in read[0]["episodes"]]
    assert float(rows[0]["mean"]) == np.mean(scores)
    # Quantiles of two scores: halfway between them and each of them.
    quartiles = [float(rows[0][f"percentile_{percent}"]) for percent in (25, 75)]
    assert quartiles == pytest.approx(min(scores) + np.array([0.25, 0.75]) * np.ptp(scores))
    assert (rows[0]["quartiles_over"], rows[0]["episodes"]) == ("variations", "2")
    assert comparison.markdown(read).splitlines()[2] == (
        f"| `straighten_rope` | {np.mean(scores):.2f} ({min(scores):.2f}) |"
    )


def test_results_of_other_protocols_are_not_mixed(tmp_path, three):
    with pytest.raises(StoreError, match=r"old.result\.json is of protocol version 0"):
        comparison.read_results([three[0], written(tmp_path / "old", protocol=0)])
    (tmp_path / "x.json").write_text("{}")
    with pytest.raises(StoreError, match="not the result of an evaluation"):
        comparison.read_results([tmp_path / "x.json"])
    with pytest.raises(StoreError, match="cannot be read"):
        comparison.read_results([tmp_path / "nothing.json"])
    with pytest.raises(StoreError, match="no results"):
        comparison.read_results([])


EPISODE = {"variation": 800, "seed": 0, "normalized_performance": 0.5, "success": False}


@pytest.mark.parametrize(
    "changes",
    [
        {"episodes": 5},
        {"episodes": []},
        {"episodes": [EPISODE]},
        {"episodes": [EPISODE, EPISODE]},
        {"episodes": [EPISODE, {**EPISODE, "variation": 802}]},
        {"episodes": [EPISODE, {**EPISODE, "variation": 801, "seed": 1}]},
        {"episodes": [EPISODE, {**EPISODE, "variation": 801, "normalized_performance": "x"}]},
        {"episodes": [EPISODE, {"variation": 801, "seed": 0}]},
        {"seeds": None},
        {"settings": [1]},
        {"planning": 3},
        {"variations": ["a"]},
        {"protocol": [1]},
    ],
    ids=str,
)
def test_what_is_not_the_result_that_it_says(changes, tmp_path, three):
    changed = {**comparison.read_results(three[:1])[0], **changes}
    write_json(tmp_path / "result.json", changed)
    with pytest.raises(StoreError, match=r"result\.json is "):
        comparison.read_results([tmp_path])


def test_figures_are_drawn_from_results(tmp_path, three):
    import imageio.v3 as imageio

    read = comparison.read_results(three)
    plots.bars(read, tmp_path / "bars.png")
    plots.curves(read[1:], tmp_path / "curves.png")
    for name in ("bars.png", "curves.png"):
        picture = imageio.imread(tmp_path / name)
        assert picture.shape[0] > 300 and len(np.unique(picture[..., 0])) > 20
    with pytest.raises(InvalidArgumentError, match=r"'\.xyz'.*'\.png'"):
        plots.bars(read, tmp_path / "bars.xyz")


def test_the_command_line_plots(tmp_path, three, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = ["plot", *map(str, three)]
    shown = output_of(*command, "--csv", "table.csv")
    assert "horizon=15" in shown.replace("\n", " ") and "quartiles" in shown
    assert (tmp_path / "table.csv").exists() and (tmp_path / "results.png").exists()
    page = output_of(*command, "--markdown")
    assert page.startswith(comparison.markdown(comparison.read_results(three)))


def test_indices_as_text():
    for text, indices in (("800,803,810-812", (800, 803, 810, 811, 812)), ("0-1", (0, 1))):
        assert parsed("variations", text) == indices
        assert as_text(reversed(indices)) == text
    for text in ("", "3-x", "3,,4", "-3", "1-2-3", "900-800", "3,5-4"):
        with pytest.raises(InvalidArgumentError, match=r"variations=.*810-819"):
            parsed("variations", text)
