"""Settings of presets: printed as they are accepted, and checked before environments exist."""

import json
import re

import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.registry import METHODS, find_preset, preset_names
from softgym_mj.learning.setup import check_settings
from tests.command import status_of

CASES = [(method, preset) for method in METHODS for preset in preset_names(method)]


def train(monkeypatch, *arguments):
    """Runs `softgym-mj train`, in which no environment can be created; returns the exit status."""
    monkeypatch.setattr("softgym_mj.make_vec", None)
    return status_of(["train", *arguments], monkeypatch)


# Updates per env step by the papers and their authors' code.
PAPERS = {"curl": 1.0, "drq": 1.0, "planet": 100 / 900, "wu": 2 / 16}
DEFAULTS = "planet", "wu"  # Methods whose defaults are the paper's settings.
LIMITED = {"wu": ("spread_cloth", "fold_cloth")}


@pytest.mark.parametrize(("method", "preset"), CASES)
def test_presets_suit_every_task(method, preset):
    for task in LIMITED.get(method, softgym_mj.TASKS):
        imitates = {"teacher": "any"} if method == "distill" else {}
        training, made = find_preset(method, preset, task, **imitates)
        assert (training.task, made.name, made.preset) == (task, method, preset)
        check_settings(training, made)
        if preset == "paper" and method in PAPERS:
            assert made.settings.updates == pytest.approx(PAPERS[method] * training.num_envs)
        if preset == "paper" and method in DEFAULTS:
            assert made.settings == type(made.settings)()


@pytest.mark.parametrize(("method", "preset"), CASES)
def test_printed_settings_are_accepted_and_change_nothing(method, preset, monkeypatch, capsys):
    command = (method, "straighten_rope", "--preset", preset, "--show-settings")
    assert train(monkeypatch, *command) == 0
    printed = capsys.readouterr().out
    assert len(json.loads(printed)) > 15  # Defaults are printed as well.
    assert train(monkeypatch, *command, "--settings", printed) == 0
    assert capsys.readouterr().out == printed


@pytest.mark.parametrize(("method", "preset"), [("sac", "fast"), ("curl", "minutes")])
def test_the_preset_without_a_choice(method, preset, monkeypatch, capsys):
    printed = []
    for chosen in ([], ["--preset", preset]):
        assert train(monkeypatch, method, "fold_cloth", *chosen, "--show-settings") == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]


# Parts of the fast preset of straighten_rope: 51,200 env steps of 256 environments.
@pytest.mark.parametrize(
    ("settings", "part"),
    [
        ({}, 51_200),
        ({"env_steps": 4_096}, 4_096),  # Shorter than a part.
        ({"env_steps": 102_400}, 51_200),
        ({"env_steps": 76_800}, 38_400),  # 300 vector steps: 150 is the largest divisor up to 200.
        ({"env_steps": 51_200, "num_envs": 100}, 51_200),
        ({"env_steps": 51_000, "num_envs": 100}, 51_000),
        ({"env_steps": 102_400, "part": 25_600}, 25_600),
    ],
)
def test_the_part_divides_the_env_steps(settings, part):
    training, _ = find_preset("sac", "fast", "straighten_rope", **settings)
    assert training.part == part


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"env_steps": 4_000}, "env_steps=4000 .*num_envs=256, such as 3840 or 4096"),
        # 401 vector steps, a prime: a part of each would evaluate at each.
        ({"env_steps": 401 * 256}, "env_steps=102656 .*part=51200, itself .*num_envs=256"),
        ({"env_steps": 4_096, "part": 3_000}, "part=3000 .*such as 2816 or 3072"),
        ({"env_steps": "many"}, "env_steps='many' .*a whole number"),
        ({"num_envs": 0}, "num_envs=0"),
        ({"part": 0}, "part=0"),
        ({"reward_scale": 0}, "reward_scale=0 .*a number > 0"),
        ({"log_std": [2, -10]}, r"log_std=\(2, -10\) .*the lower bound"),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, message):
    with pytest.raises(InvalidArgumentError, match=message):
        find_preset("sac", "fast", "straighten_rope", **settings)


@pytest.mark.parametrize(
    ("task", "settings", "message"),
    [
        ("straighten_rope", {"env_steps": 4_096}, "random_steps=10240 .*0 to 3840"),
        (
            "straighten_rope",
            {"observation": "rgb"},
            "observation='rgb' .*a state with sac; planet, wu, curl, drq, distill, teacher_student"
            " learn from images",
        ),
        (
            "pour_water",
            {"symmetric": True},
            """task='pour_water'.*--settings '{"symmetric": false}'""",
        ),
    ],
)
def test_what_would_not_learn_is_refused_before_environments_are_created(
    task, settings, message, monkeypatch, capsys
):
    command = ("sac", task, "--device", "host", "--settings", json.dumps(settings))
    assert train(monkeypatch, *command) == 1
    printed = capsys.readouterr()
    assert "creating" not in printed.out
    assert re.search(message, printed.err)
