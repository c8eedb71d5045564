"""Learned results: rows, tables by hand, the queue, and what is committed."""

import dataclasses
import itertools
import json
import pathlib
import tomllib

import numpy as np
import pytest

from softgym_mj.envs.load import load
from softgym_mj.evaluation.comparison import read_results
from softgym_mj.evaluation.plots import new_figure
from softgym_mj.exceptions import StoreError
from softgym_mj.learning import curves, results
from softgym_mj.learning.entering import enter
from softgym_mj.learning.registry import PRESETS
from softgym_mj.learning.results import Reference, Row
from softgym_mj.learning.tables import table
from softgym_mj.policies.planners import BUDGET
from softgym_mj.registry import DOMAIN, TASKS, task_names
from tests.command import error_of, output_of
from tools import learned
from tools.queued_runs import QueuedRun, read_queue
from tools.run_queue import waiting

ROOT = pathlib.Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
SCORES = (0.4, 1.0, 0.0, 0.9, 0.5)  # Final held-out scores of seeds 0..4.
NAME = results.Name("straighten_rope", "default", "sac", "reduced", "fast", "symmetric")
REFERRED = (NAME.task, NAME.method, NAME.observation)
OWN = NAME._replace(method="sac_own")  # A method of somebody else.
HEAD = ",".join(curves.COLUMNS)
LINE = "straighten_rope,default,sac,reduced,fast,plain,0,100,50,6.5,evaluate,200,0.5,0.25,1"


def _row(seed, env_steps, split, score, final, name=NAME):
    seconds, episodes = 0.6 * env_steps, 200 if final and split == "evaluate" else 20
    success = float(score > 0.8)
    counts = seed, env_steps, env_steps // 2, seconds
    return Row(*name, *counts, split, episodes, score, success, final)


def _training(name=NAME):
    """Five seeds, which were best in the middle, and 0.1 better where they have learned."""
    return [
        _row(seed, env_steps, split, score + (0.1 if split == "train" else 0.0), final, name)
        for seed, last in enumerate(SCORES)
        for env_steps, score, final in ((100, -0.2, False), (200, 1.0, False), (300, last, True))
        for split in ("train", "evaluate")
    ]


def _own():
    return [
        dataclasses.replace(row, normalized_performance=min(row.normalized_performance, 1.0))
        for row in _training(OWN)
    ]


def _publish(folder, rows):
    """Writes a whole training in a folder."""
    results.write_rows(rows, folder / "curve.csv")
    final = [row for row in rows if row.final and row.split == "evaluate"]
    infos = {name: np.array([[getattr(row, name)] * 200 for row in final])
             for name in ("normalized_performance", "success")}  # fmt: skip
    curves.write_episodes(folder, [row.seed for row in final], range(800, 1000), infos)
    card = {
        "method": rows[0].method, "preset": rows[0].preset, "seeds": [row.seed for row in final],
        "evaluations": sorted({row.env_steps for row in rows}), "seconds": 180.0,
        "training": {"task": rows[0].task, "observation": rows[0].observation, "env_steps": 300},
    }  # fmt: skip
    (folder / "card.json").write_text(json.dumps(card))


@pytest.fixture(name="folder")
def _folder(tmp_path):
    """Published results, of nothing yet, and a queue."""
    (tmp_path / "learning.csv").write_text(f"{HEAD}\n")
    (tmp_path / "references.csv").write_text((RESULTS / "references.csv").read_text())
    entries = [
        'task = "straighten_rope"\nmethod = "sac"\npreset = "fast"\nreplay = "symmetric"\n'
        f'seeds = {seeds}\nwhy = "w"\ngpu_minutes = 2\n'
        for seeds in (5, 6)
    ]
    (tmp_path / "queue.toml").write_text("".join(f"[[run]]\n{entry}" for entry in entries))
    _publish(tmp_path / "training", _own())
    return tmp_path


# ---------------------------------------------------------------------- numbers


def test_the_table_by_hand():
    known = [
        Reference(*REFERRED, 1000, 0.74, "is", "plot", "far"),
        Reference(*REFERRED, 250, 0.7, "is", "plot", "near"),
        Reference(*REFERRED, 300, 0.8, "below", "plot", "a bound"),
        Reference("fold_cloth", *REFERRED[1:], 300, 0.3, "is", "plot", "another task"),
    ]
    (line,) = table(_training(), known)
    assert tuple(line[key] for key in results.Name._fields) == NAME
    assert (line["seeds"], line["env_steps"], line["updates"], line["episodes"]) == (
        5,
        300,
        150,
        200,
    )
    # Sorted: 0, 0.4, 0.5, 0.9, 1. A quarter of five, rounded down, is left out at either end.
    expected = {"median": 0.5, "percentile_25": 0.4, "percentile_75": 0.9, "iqm": 0.6, "min": 0.0}
    expected |= {"minutes": 3.0, "gap": 0.1, "published": 0.7, "success_rate": 0.4}
    assert {key: line[key] for key in expected} == pytest.approx(expected)
    # All ways of drawing five seeds of five, with replacement.
    means = [np.mean(sorted(drawn)[1:4]) for drawn in itertools.product(SCORES, repeat=5)]
    interval = np.percentile(means, [2.5, 97.5])
    assert (line["iqm_low"], line["iqm_high"]) == pytest.approx(interval, abs=0.035)


def test_minutes_of_seeds_that_were_trained_apart_add_up():
    apart = [dataclasses.replace(row, seconds=90.0) if row.seed > 2 else row for row in _training()]
    (line,) = table(apart)
    assert line["minutes"] == pytest.approx(3.0 + 1.5)


def test_one_seed_has_no_spread_and_other_lengths_are_other_lines():
    short = [_row(0, 200, "evaluate", 0.3, True, NAME._replace(task="fold_cloth"))]
    longer = [dataclasses.replace(short[0], env_steps=400)]
    lines = table([*short, *longer, _row(1, 900, "evaluate", 0.9, False)])
    assert [(line["env_steps"], line["median"], line["iqm"]) for line in lines] == [
        (200, 0.3, 0.3),
        (400, 0.3, 0.3),
    ]
    missing = ("percentile_25", "iqm_low", "iqm_high", "gap", "published")
    assert [lines[0][key] for key in missing] == [None] * 5
    assert table([]) == []


def test_curves_by_hand():
    rows = [*_training(), _row(0, 400, "evaluate", 0.3, False)]  # The others are not there yet.
    (points,) = learned.curves(rows).values()
    expected = [(100, -0.2, -0.2, -0.2), (200, 1.0, 1.0, 1.0), (300, 0.5, 0.4, 0.9)]
    np.testing.assert_allclose(points, expected)
    assert not learned.curves(rows[-1:])


def test_the_figure_is_drawn_where_there_are_curves(tmp_path):
    known = [Reference(*REFERRED, 250, 0.7, "is", "plot", "near")]
    learned.draw(_training()[:2], known, tmp_path / "none.png")
    learned.draw(_training(), known, tmp_path / "some.png")
    assert not (tmp_path / "none.png").exists()
    assert (tmp_path / "some.png").stat().st_size > 10_000


def test_a_panel_has_all_numbers_of_others():
    known = [Reference(*REFERRED, 250, 0.1 * k, "is", "plot", "near") for k in range(5)]
    axes = new_figure(3.0, 3.0).subplots()
    learned._panel(axes, NAME.task, learned.curves(_training()), known)
    drawn = [line.get_ydata()[0] for line in axes.lines if "others" in line.get_label()]
    assert drawn == [reference.value for reference in known]


def test_the_overview_is_there_once_something_was_learned(monkeypatch):
    cem = results.Name("fold_cloth", "default", "cem", "simulator", "paper", "none")
    planned = [
        _row(0, 300, "evaluate", 0.9, True, cem),
        _row(0, 300, "evaluate", 0.4, True, cem._replace(preset="small")),
    ]
    monkeypatch.setattr(learned, "rows", lambda: planned)
    monkeypatch.setattr(learned, "idle", lambda: {"fold_cloth": 0.25})
    assert learned.overview() == ""
    worse = [
        dataclasses.replace(row, replay="plain", normalized_performance=0.1) for row in _training()
    ]
    monkeypatch.setattr(learned, "rows", lambda: [*planned, *worse, *_training()])
    head, _, *rows = learned.overview().splitlines()[:4]
    states, images = (
        "RL on states | imitated expert, states",
        "images + proprioception | images alone",
    )
    assert head == f"| task | no action | {states} | {images} | CEM |"
    assert rows == [
        "| `fold_cloth` | 0.25 | | | | | 0.90 (100%) |",
        "| `straighten_rope` | | 0.50 (40%) SAC | | | | |",
    ]
    assert learned.summary().splitlines()[2:4] == rows
    for method, observation, cells in (
        ("distill", "markov", "| | | 0.50 (40%) | | | |"),
        ("sac", "rgb+held", "| | | | 0.50 (40%) SAC | | |"),
        ("sac", "rgb", "| | | | | 0.50 (40%) SAC | |"),
    ):
        own = [
            dataclasses.replace(row, method=method, observation=observation) for row in _training()
        ]
        monkeypatch.setattr(learned, "rows", lambda own=own: own)
        assert cells in learned.overview()


def test_what_doing_nothing_scores_is_of_all_held_out_variations():
    assert set(learned.idle()) == {*task_names(DOMAIN)}
    assert learned.idle()["straighten_rope"] == pytest.approx(0.493, abs=0.002)


def test_what_is_marked_as_old_is_published():
    names = {(row.task, row.method, row.preset, row.observation) for row in learned.rows()}
    assert names >= learned.STALE


# ---------------------------------------------------------------------- files


def test_columns_are_those_that_trainings_write():
    assert tuple(field.name for field in dataclasses.fields(Row)) == curves.COLUMNS


def test_rows_are_read_as_they_were_written(tmp_path):
    rows = [*_training(), dataclasses.replace(_training()[0], seed=7, seconds=None)]
    results.write_rows(rows, tmp_path / "a.csv")
    read = results.read_rows(tmp_path / "a.csv")
    assert sorted(read, key=lambda row: row.key) == sorted(rows, key=lambda row: row.key)
    results.write_rows(read, tmp_path / "b.csv")
    assert results.read_rows(tmp_path / "b.csv") == read
    curves.write_curve(tmp_path, [{**vars(row), "final": int(row.final)} for row in rows])
    assert results.read_folder(tmp_path) == read


def test_merging_twice_changes_nothing_and_other_results_are_refused():
    rows = _training()
    once = results.merged(rows[:7], rows)
    assert len(once) == len(rows) == 30
    assert results.merged(once, rows) == results.merged(rows[::-1]) == once
    other = dataclasses.replace(rows[3], normalized_performance=0.99)
    with pytest.raises(StoreError, match=r"two results of one evaluation.*0\.99"):
        results.merged(once, [other])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: columns"),
        (HEAD.replace("seed", "sead"), "line 1: columns.*'sead'"),
        (f"{HEAD}\n{LINE}\n{LINE[:-2]}", "line 3: it ends at column 'success'"),
        (f"{HEAD}\n{LINE},1", "line 2: it ends at column 'final'"),
        (f"{HEAD}\n{LINE.replace('straighten', 'bend')}", "line 2: task='bend_rope'.*fold_cloth"),
        (f"{HEAD}\n{LINE.replace('sac', 'S AC')}", "line 2: method='S AC'"),
        (f"{HEAD}\n{LINE.replace(',100,', ',-1,')}", "line 2: env_steps='-1'.*whole number"),
        (f"{HEAD}\n{LINE.replace(',50,', ',5.5,')}", r"line 2: updates='5\.5'"),
        (f"{HEAD}\n{LINE.replace('6.5', 'inf')}", "line 2: seconds='inf'"),
        (f"{HEAD}\n{LINE.replace('evaluate', 'all')}", "line 2: split='all'.*train, evaluate"),
        (f"{HEAD}\n{LINE.replace('0.5', 'nan')}", "normalized_performance='nan'.*finite"),
        (f"{HEAD}\n{LINE.replace('0.5', '')}", "normalized_performance=''"),
        (f"{HEAD}\n{LINE.replace('0.25', '25')}", r"success='25'.*0\.\.1"),
        (f"{HEAD}\n{LINE[:-1]}yes", "line 2: final='yes'.*0 or 1"),
        (f"{HEAD}\n{LINE}\n{LINE.replace('0.5', '0.6')}", "two results of one evaluation"),
    ],
)
def test_bad_files_are_refused_by_line_and_column(tmp_path, text, message):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(StoreError, match=message):
        results.read_folder(tmp_path)
    (tmp_path / "curve.csv").write_bytes(b"\xff")
    with pytest.raises(StoreError, match=r"curve\.csv cannot be read"):
        results.read_folder(tmp_path)


def test_evaluations_of_planners_are_rows():
    (rope,) = read_results([RESULTS / "straighten_rope-cem.json"])
    (row,) = results.rows_of_planner(rope)
    # 75 env steps, 15 decisions of 450.
    assert (row.env_steps, row.updates, row.seconds, row.episodes) == (6_750, 0, None, 5)
    assert (row.method, row.preset, row.split, row.final) == ("cem", "small", "evaluate", True)
    assert row.normalized_performance == pytest.approx(rope["summary"]["mean"])
    paper = {"horizon": 15, "budget": 21_000, "iterations": 10, "replan_every": 1}
    (row,) = results.rows_of_planner({**rope, "planning": paper})
    assert (row.preset, row.env_steps) == ("paper", 1_575_000)
    (row,) = results.rows_of_planner({**rope, "planning": paper, "settings": {"fidelity": "fast"}})
    assert row.preset == "small"
    for settings in ({"actor": "pick_and_place"}, {"horizon": 6}):
        (row,) = results.rows_of_planner({**rope, "settings": settings})
        decisions = -(-load("straighten_rope", **settings).horizon // 5)
        assert row.env_steps == 450 * decisions
    for changes in ({"policy": "random"}, {"variations": [799, 800]}):
        with pytest.raises(StoreError, match="expected a planner"):
            results.rows_of_planner({**rope, **changes})


# ---------------------------------------------------------------------- commands


def test_the_table_takes_in_trainings_once(folder):
    assert "no final rows" in output_of("learning", "table", "--results", folder)
    shown = output_of("learning", "table", folder / "training", "--results", folder)
    assert "0.500" in shown and "0.40..0.90" in shown
    assert results.read_rows(folder / "learning.csv") == []
    for number in (30, 0):
        shown = output_of("learning", "table", folder / "training", "--merge", "--results", folder)
        assert f"30 rows, {number} of them new" in " ".join(shown.split())
        assert len(results.read_rows(folder / "learning.csv")) == 30
    output_of("learning", "table", "--results", folder, "--csv", folder / "table.csv")
    head, row = (folder / "table.csv").read_text().splitlines()
    assert dict(zip(head.split(","), row.split(","), strict=True))["median"] == "0.5"


def _changed(rows, change, which=lambda row: True):
    return [dataclasses.replace(row, **change) if which(row) else row for row in rows]


@pytest.mark.parametrize(
    ("rows", "card", "message"),
    [
        (lambda rows: _changed(rows, {"normalized_performance": 7.5}), {}, "score 7.5.*above 1"),
        (lambda rows: [row for row in rows if not row.seed], {"seeds": [0]}, r"seeds \[0\], not 0"),
        (lambda rows: _changed(rows, {"seed": 9}, lambda row: row.seed == 4), {}, "seeds are"),
        (lambda rows: _changed(rows, {"episodes": 4}, lambda row: row.final), {}, r"of \[4\] held"),
        (lambda rows: [row for row in rows if row.env_steps != 200], {}, "not whole: 10 of 30"),
        (lambda rows: rows[:-1], {}, "not whole: 1 of 30"),
        (lambda rows: _changed(rows, {"final": False}), {}, "rows are final before the last"),
        (lambda rows: _changed(rows, {"final": True}), {}, "rows are final before the last"),
        (lambda rows: rows, {"evaluations": [100, 200, 300, 400]}, "not whole: 10 of 40"),
        (lambda rows: rows, {"evaluations": [100, 300]}, "10 rows are of evaluations that"),
        (lambda rows: rows, {"evaluations": ["100"]}, "card.json does not list"),
        (lambda rows: rows, {"seeds": [0, 1]}, r"and \[0, 1\] in card.json"),
        (lambda rows: rows, {"seconds": "many"}, "seconds in card.json are 'many'"),
        (lambda rows: rows, {"method": "sac"}, "method is sac_own in curve.csv and 'sac' in card"),
        (lambda rows: rows, {"training": {"task": "fold_cloth"}}, "task is straighten_rope in"),
        (lambda rows: rows, {"training": {"actor": "franka"}}, "actor is default in .*'franka'"),
        (lambda rows: rows, {"training": {"fidelity": "fast"}}, "table's: fidelity is 'fast'"),
        (lambda rows: rows, {"training": {"arguments": {"a": "x"}}}, "arguments is {'a': 'x'}"),
        (
            lambda rows: _changed(rows, {"normalized_performance": 0.99}, lambda row: row.final),
            {},
            "seed 0 has 0.99 in curve.csv, and 0.4 is the mean of episodes.csv",
        ),
        (lambda rows: _changed(rows, {"method": "sac"}), {"method": "sac"}, "512000 in the preset"),
        # A training that a time limit has ended.
        (lambda rows: rows, {"training": {"env_steps": 512_000}}, "after 300 of 512000 env steps"),
    ],
)
def test_results_that_break_rules_are_not_merged(folder, rows, card, message):
    training = folder / "training"
    results.write_rows(rows(_own()), training / "curve.csv")
    content = json.loads((training / "card.json").read_text())
    changed = card | {"training": content["training"] | card.get("training", {})}
    (training / "card.json").write_text(json.dumps(content | changed))
    with pytest.raises(StoreError, match=rf"(?s)training is not merged: .*{message}"):
        enter(training)
    error = error_of("learning", "table", training, "--merge", "--results", folder)
    assert isinstance(error, StoreError) and results.read_rows(folder / "learning.csv") == []


def test_several_observations_are_named_as_in_the_card(folder):
    rows = [dataclasses.replace(row, observation="rgb+held") for row in _own()]
    _publish(folder / "training", rows)
    card = json.loads((folder / "training" / "card.json").read_text())
    card["training"]["observation"] = ["rgb", "held"]
    (folder / "training" / "card.json").write_text(json.dumps(card))
    assert {row.name for row in enter(folder / "training")} == {
        OWN._replace(observation="rgb+held")
    }


def test_results_without_their_other_files_are_not_merged(folder):
    (folder / "training" / "episodes.csv").write_text("seed,variation\n0,800\n")
    with pytest.raises(StoreError, match=r"episodes\.csv cannot be read: line 2"):
        enter(folder / "training")
    (folder / "training" / "episodes.csv").unlink()
    with pytest.raises(StoreError, match=r"there is no episodes\.csv"):
        enter(folder / "training" / "curve.csv")
    (folder / "training" / "card.json").unlink()
    with pytest.raises(StoreError, match=r"there is no card\.json"):
        enter(folder / "training")


def test_published_results_are_those_of_a_checkout(tmp_path):
    assert "pass --results" in str(error_of("learning", "table", "--results", tmp_path))


def test_long_fields_are_refused(tmp_path):
    (tmp_path / "curve.csv").write_text(f"{HEAD}\n{'a' * 200_000}{LINE}\n")
    with pytest.raises(StoreError, match=r"curve\.csv cannot be read: line 2: field larger"):
        results.read_folder(tmp_path)


def test_the_queue_goes_on_with_what_is_not_done(folder):
    command = "softgym-mj train sac straighten_rope --preset fast --seeds {}"
    assert waiting(folder)[0].command.startswith(command.format(5))
    results.write_rows(_training(), folder / "learning.csv")
    (run,) = waiting(folder)
    assert run.command.startswith(command.format(6))
    more = [_row(5, 300, "evaluate", 0.1, True)]
    results.write_rows([*_training(), *more], folder / "learning.csv")
    assert waiting(folder) == []


@pytest.mark.parametrize(
    "changes",
    [{"final": False}, {"split": "train"}, {"episodes": 199}, {"env_steps": 200}, {"seed": 9}]
    + [{key: "other"} for key in results.Name._fields],
)
def test_a_run_is_done_by_final_rows_of_all_its_seeds(changes):
    how = {"replay": NAME.replay, "env_steps": 300, "gpu_minutes": 1}
    run = QueuedRun(NAME.task, NAME.method, NAME.preset, 2, "why", **how)
    rows = [_row(seed, 300, "evaluate", 0.5, True) for seed in range(2)]
    assert run.is_done(rows)
    assert not run.is_done([rows[0], dataclasses.replace(rows[1], **changes)])


def test_commands_have_what_settings_replace():
    run = QueuedRun("fold_cloth", "sac", "fast", 3, "", settings={"part": 512}, core_hours=2)
    assert "--seeds 3 --settings '{\"part\": 512}' --device cuda --out training/" in run.command
    custom = ("fold_cloth", "default", "sac", "reduced", "custom", "plain")
    for env_steps, done in ((1_024_000, True), (409_600, False)):
        rows = [_row(seed, env_steps, "evaluate", 0.1, True, custom) for seed in range(3)]
        assert run.is_done(rows) == done
    planner = {"observation": "simulator", "replay": "none", "episodes": 10, "gpu_minutes": 1}
    run = QueuedRun("fold_cloth", "cem", "paper", 1, "", settings={"budget": 7}, **planner)
    assert run.command.startswith("softgym-mj evaluate fold_cloth --policy cem --episodes 10")
    assert "--budget 7 --device cuda" in run.command
    assert run.cost == "1 GPU min"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("gpu_minutes = 2\ncolor = 3", "run 1: .*color"),
        ("core_hours = 2\ngpu_minutes = 2", "run 1: gpu_minutes"),
        ("core_hours = 'two'", "run 1: core_hours='two'"),
        ("core_hours = ", "cannot be read"),
        ('gpu_minutes = 2\nmethod = "sacc"', "run 1: method='sacc'.*'sac'"),
    ],
)
def test_bad_queues_are_refused(tmp_path, change, message):
    entry = 'task = "fold_cloth"\npreset = "fast"\nseeds = 1\n'
    if "method" not in change:
        entry += 'method = "sac"\n'
    (tmp_path / "queue.toml").write_text(f'[[run]]\n{entry}why = "w"\n{change}\n')
    with pytest.raises(StoreError, match=message):
        read_queue(tmp_path / "queue.toml")


# ---------------------------------------------------------------------- what is committed


def test_committed_rows_are_in_order_and_have_the_planners_evaluations(tmp_path):
    rows = learned.rows()
    results.write_rows(rows, tmp_path / "learning.csv")
    assert (tmp_path / "learning.csv").read_text() == (RESULTS / "learning.csv").read_text()
    for task in task_names(DOMAIN):
        assert set(results.read_folder(RESULTS / f"{task}-cem.json")) <= set(rows)
    assert {reference.task for reference in learned.references()} <= set(TASKS)


def test_the_committed_queue_suits_presets_and_tasks():
    runs = read_queue(RESULTS / "queue.toml")
    commands_ = [run.command for run in runs]
    assert len(set(commands_)) == len(commands_)
    outs = [command.split("--out ")[1] for command in commands_]
    assert len(set(outs)) == len(outs)
    for run in runs:
        if run.plans:
            budget = run.settings.get("budget", BUDGET)
            assert run.env_steps == TASKS[run.task].horizon * budget
            continue
        file = PRESETS / f"{run.method}.toml"
        if file.exists():  # File of a method that exists already.
            assert run.preset in tomllib.loads(file.read_text())
