"""Trainings: what was killed at any point ends with the same numbers."""

import csv
import dataclasses
import json
import math
import re
import tomllib
import zipfile

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.learning.curves import COLUMNS
from softgym_mj.learning.registry import METHODS, PRESETS, find_method, find_preset
from softgym_mj.learning.results import read_rows
from softgym_mj.learning.settings import OBSERVATIONS, TrainingSettings
from softgym_mj.learning.training import Training
from softgym_mj.policies.exported import observes
from softgym_mj.policies.factory import make_policy
from softgym_mj.robots.gripper import HELD
from tests.command import invoked

SEEDS = [4, 9]
METHOD = find_method(
    "sac", hidden=(16, 16), random_steps=8, updates=2, batch=8, replay=24, n_step=2,
    symmetric=True, symmetrize_policy=True,
)  # fmt: skip
SETTINGS = TrainingSettings(
    "straighten_rope", env_steps=32, num_envs=2, part=8, evaluate_every=2, episodes=1,
    final_episodes=2, fidelity="fast", episode_steps=6,
)  # fmt: skip


def _training(folder, seeds=SEEDS, settings=SETTINGS):
    return Training(settings, METHOD, seeds, folder, "host")


class Killed(Exception):
    """Ends a training where it is."""


def rows_of(training):
    """Its curve, but for how long it took."""
    return [{name: row[name] for name in row if name != "seconds"} for row in training.rows]


def result_of(training):
    """Its curve, what was learned, and how the last episodes ended."""
    weights = [p.detach().tolist() for p in training.learner.algorithm.actor.parameters()]
    return rows_of(training), weights, (training.folder / "episodes.csv").read_text()


@pytest.fixture(name="whole", scope="module")
def _whole(tmp_path_factory):
    training = _training(tmp_path_factory.mktemp("whole"))
    training.run()
    return training


def test_a_curve_has_a_row_of_each_evaluation_seed_and_split(whole):
    with (whole.folder / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [(r["env_steps"], r["split"], r["seed"], r["final"]) for r in rows] == [
        (str(steps), split, str(seed), final)
        for steps, final in ((16, "0"), (32, "1"))
        for split in ("train", "evaluate")
        for seed in SEEDS
    ]
    assert [row["episodes"] for row in rows[-2:]] == ["2", "2"]
    assert {row["replay"] for row in rows} == {"symmetric"}
    assert all(-3.0 < float(row["normalized_performance"]) <= 1.0 for row in rows)
    assert rows[-1]["updates"] == str(2 * (32 - 8) // 2)


def test_episodes_are_left_early_where_they_are_learned_from(tmp_path, no_policies):
    settings = dataclasses.replace(SETTINGS, learned_steps=4, num_envs=1, evaluate_every=4)
    training = _training(tmp_path, settings=settings)
    horizons, make = [], training._make

    def monitored(*own, **named):
        envs = make(*own, **named)
        horizons.append(envs.get_attr("horizon")[0])
        return envs

    training._make = monitored
    training.run()
    ended = training.learner.replay.arrays["ended"][:, 0, 0].tolist()
    # The newest 24 of four parts of 8, each of which begins anew: episodes of 4, none of 6.
    assert ended == 6 * [False, False, False, True]
    assert horizons == [6]  # Horizon of evaluations.


@pytest.mark.parametrize("learned_steps", [None, 4])
@pytest.mark.parametrize(
    ("actor", "steps"), [(None, None), (None, 6), ("pixel_pick_and_place", None)]
)
def test_evaluations_have_the_horizon_of_their_environments(tmp_path, learned_steps, actor, steps):
    settings = dataclasses.replace(
        SETTINGS, learned_steps=learned_steps, episode_steps=steps, actor=actor
    )
    method = find_method("sac", hidden=(8,), random_steps=8, replay=24)
    training = Training(settings, method, [0], tmp_path, "host")
    assert training.evaluation_steps(1) == training._make(1).get_attr("horizon")[0]


def test_how_each_episode_of_the_last_evaluation_ended_is_written(whole):
    with (whole.folder / "episodes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["seed"], row["variation"]) for row in rows] == [
        (str(seed), variation) for seed in SEEDS for variation in ("800", "900")
    ]
    for seed, row in zip(SEEDS, whole.rows[-2:], strict=True):
        own = [float(r["normalized_performance"]) for r in rows if r["seed"] == str(seed)]
        assert np.mean(own) == row["normalized_performance"]
    assert all(0.0 <= float(row["episode_max_edge_strain"]) < 1.0 for row in rows)


def test_policies_are_written_and_play_as_the_learner(whole):
    env = softgym_mj.load("straighten_rope", split="all", observation="reduced", fidelity="fast")
    for k, seed in enumerate(SEEDS):
        with zipfile.ZipFile(whole.folder / f"policy_{seed}.pt2") as file:
            assert not any(b"/learning/" in file.read(name) for name in file.namelist())
        act = make_policy(str(whole.folder / f"policy_{seed}.pt2"), env, seed, trust=True)
        timestep = env.reset(830)
        seen = torch.tensor(next(iter(timestep.observation.values()))).float()
        both = seen.expand(2, 1, -1)
        no = torch.zeros(2, 1, dtype=torch.bool)
        expected, _ = whole.learner.act(both, no, None, explore=False)
        np.testing.assert_allclose(act(timestep), expected[k, 0].numpy(), atol=1e-6)


def test_who_sees_what_is_held_plays_as_its_evaluation(tmp_path):
    """The file plays an episode in MuJoCo as the training's own evaluation does."""
    settings = dataclasses.replace(SETTINGS, observation="markov")
    training = _training(tmp_path, SEEDS[:1], settings)
    training.run()
    assert training.learner.replay.sample(1).observation.shape[-1] == 36 + 8
    scores = training.play([830])["normalized_performance"][:, 0]
    env = softgym_mj.load(
        "straighten_rope", split="all", observation="markov", **settings.task_settings
    )
    for k, seed in enumerate(training.seeds):
        name = str(tmp_path / f"policy_{seed}.pt2")
        assert observes(name) == {"observation": "markov"}
        for _ in env.play(make_policy(name, env, seed, trust=True), 830):
            pass
        assert env.info()["normalized_performance"] == pytest.approx(scores[k], abs=1e-3)


def test_a_card_says_what_a_checkpoint_is(whole):
    card = json.loads((whole.folder / "card.json").read_text())
    assert (card["method"], card["env_steps"], card["seeds"]) == ("sac", 32, SEEDS)
    assert card["settings"]["hidden"] == [16, 16] and card["training"]["num_envs"] == 2
    assert [row["split"] for row in card["last"]] == ["train", "train", "evaluate", "evaluate"]


def _kill_after_two_parts(training):
    def kill(training, news):
        if training.done == 2:
            raise Killed

    with pytest.raises(Killed):
        training.run(kill)


def test_nothing_is_kept_of_a_part_without_checkpoints(whole, tmp_path, no_policies):
    _kill_after_two_parts(_training(tmp_path))
    again = _training(tmp_path)
    again.learner.algorithm.update = lambda batch: (_ for _ in ()).throw(Killed)
    with pytest.raises(Killed):
        again.run()
    again = _training(tmp_path)
    again.run()
    assert result_of(again) == result_of(whole)


def test_what_was_killed_in_an_evaluation_ends_alike(whole, tmp_path, no_policies):
    killed = _training(tmp_path)
    play, left = killed.play, 1  # In the last evaluation.

    def kill(variations):
        nonlocal left
        left -= 1
        if left < 0:
            raise Killed
        return play(variations)

    killed.play = kill
    with pytest.raises(Killed):
        killed.run()
    again = _training(tmp_path)
    again.run()
    assert result_of(again) == result_of(whole)


def test_presets_are_found_by_name_and_changed():
    training, method = find_preset("sac", "fast", "fold_cloth", episodes=7, hidden=[8])
    assert (training.task, method.name, method.preset) == ("fold_cloth", "sac", "custom")
    assert (training.episodes, method.settings.hidden) == (7, (8,))
    same = find_preset("sac", "fast", "fold_cloth", episodes=20)
    assert same == find_preset("sac", "fast", "fold_cloth") and same[1].preset == "fast"
    with pytest.raises(InvalidArgumentError, match="preset='slow'"):
        find_preset("sac", "slow", "fold_cloth")
    with pytest.raises(InvalidArgumentError, match="method='none'"):
        find_preset("none", "fast", "fold_cloth")
    with pytest.raises(InvalidArgumentError, match="settings='hiden'"):
        find_preset("sac", "fast", "fold_cloth", hiden=[8])
    with pytest.raises(InvalidArgumentError, match="observation="):
        find_preset("sac", "fast", "fold_cloth", observation=["full"])


@pytest.mark.parametrize("method", METHODS)
def test_sections_of_presets_are_of_tasks_and_observations(method):
    # Those with another name would never count.
    presets = tomllib.loads((PRESETS / f"{method}.toml").read_text())
    for preset in presets.values():
        assert preset.pop("based_on", "paper") in {*presets, "paper"}
        observations = preset.pop("observations", {})
        names = {name for observed in observations for name in observed.split("+")}
        assert names <= {*OBSERVATIONS, HELD}
        for layer in (preset, *observations.values()):
            tasks = layer.pop("tasks", {})
            assert set(tasks) <= set(softgym_mj.TASKS)
            for settings in (layer, *tasks.values()):
                assert set(settings) <= {"training", "method"}


@pytest.mark.parametrize(
    "task, observation, rate, halved, alpha_rate",
    [
        ("straighten_rope", "reduced", 1e-3, 150_000, 1e-3),
        ("straighten_rope", "full", 5e-4, 150_000, 1e-3),
        ("fold_cloth", "reduced", 5e-4, 0, 2e-5),
        ("fold_cloth", "full", 5e-4, 150_000, 2e-5),
        ("spread_cloth", "reduced", 1e-3, 0, 1e-3),
        ("transport_water", "full", 1e-3, 150_000, 1e-3),
    ],
)
def test_rates_of_the_paper(task, observation, rate, halved, alpha_rate):
    # The paper's table of rates, and the launch scripts where full states are not in it.
    settings = find_preset("sac", "paper", task, observation=observation)[1].settings
    assert (settings.actor_rate, settings.critic_rate) == (rate, rate)
    assert (settings.lr_halving_period, settings.alpha_rate) == (halved, alpha_rate)


def test_a_training_that_has_ended_goes_on_to_more_env_steps(whole, tmp_path, no_policies):
    """24 env steps, the third part; then 32, of which the curve has points at 16 and 32."""
    _training(tmp_path, settings=dataclasses.replace(SETTINGS, env_steps=24)).run()
    assert {row.env_steps for row in read_rows(tmp_path / "curve.csv") if row.final} == {24}
    longer = _training(tmp_path)
    longer.run()
    assert result_of(longer) == result_of(whole)


def test_a_training_becomes_a_shorter_one_that_it_has_not_passed(tmp_path, no_policies):
    """Killed after the second of four parts, then of three; two are fewer than it has then."""
    _kill_after_two_parts(_training(tmp_path / "killed"))
    settings = dataclasses.replace(SETTINGS, env_steps=24)
    shorter, expected = (_training(tmp_path / name, settings=settings) for name in ("killed", "24"))
    for training in (shorter, expected):
        training.run()
    assert result_of(shorter) == result_of(expected)
    passed = _training(tmp_path / "killed", settings=dataclasses.replace(SETTINGS, env_steps=16))
    with pytest.raises(InvalidArgumentError, match=r"env_steps=16 .* 24 or more, .* has 24 env"):
        passed.run()


def test_points_are_told_within_parts_with_scores_of_explored_episodes(tmp_path, no_policies):
    calls = []
    _training(tmp_path).run(lambda now, news: calls.append((now.env_steps, news)), points=8)
    assert [covered for covered, _ in calls] == [4, 8, 12, 16, 20, 24, 28, 32]
    name = "explored/normalized_performance"
    scores = [news[name] for _, news in calls if name in news]
    assert scores and all(len(each) == len(SEEDS) for each in scores)
    # Episodes have six env steps; those of a part's first environments begin half over.
    assert not any(math.isnan(score) for score in scores[1])


def test_other_settings_are_refused(whole):
    other = TrainingSettings(**{**vars(SETTINGS), "episodes": 2})
    with pytest.raises(StoreError, match="other settings"):
        _training(whole.folder, settings=other).run()
    for name, value in (("part", 7), ("num_envs", 0), ("episodes", 500)):
        with pytest.raises(InvalidArgumentError, match=name):
            TrainingSettings(**{**vars(SETTINGS), name: value})


@pytest.mark.parametrize(
    "device, own", [("host", {}), pytest.param("cpu", {"action": "joints"}, marks=pytest.mark.long)]
)
def test_a_task_is_trained_with_arguments_of_its_own(tmp_path, no_policies, device, own):
    arguments = {"domain": {"friction": [1.31, 1.32]}, "action_repeat": 1, **own}
    small = {**vars(SETTINGS), **vars(METHOD.settings), "arguments": arguments, "env_steps": 16}
    if own:  # Arms have no symmetries.
        small |= {"actor": "franka", "final_episodes": 1}
        del small["symmetric"], small["symmetrize_policy"]
    settings, method = find_preset("sac", "fast", small.pop("task"), **small)
    training = Training(settings, method, [0], tmp_path, device)
    training.run()
    card = json.loads((tmp_path / "card.json").read_text())
    assert card["preset"] == method.preset == "custom"
    assert card["training"]["arguments"] == arguments
    envs = training._make(1, split="all")  # Evaluations have them as well.
    _, infos = envs.reset(seed=3)
    assert 1.31 <= infos["domain_friction"][0] <= 1.32
    assert envs.single_action_space.shape == ((16,) if own else (8,))  # Seven joints, a gripper.


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"observation": "full"}, "observation"),
        ({"image_size": [8, 8]}, "image_size"),
        ({"horizon": 3}, "episode_steps"),
        ({"split": "all"}, "training split"),
        ({"actoin": "pose"}, "unexpected keyword argument 'actoin'.*'action_repeat'"),
        ({"action_repeat": "4"}, "action_repeat='4'"),
    ],
)
def test_bad_arguments_of_tasks_are_refused(tmp_path, arguments, message):
    command = ["train", "sac", "straighten_rope", "--device", "host", "--out", str(tmp_path)]
    done = invoked(*command, "--task-settings", json.dumps(arguments))
    assert done.exit_code != 0
    assert re.search(message, " ".join(f"{done.output} {done.exception}".split()))


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"task": "fold_cloth"}, "settings='task'"),
        ({"name": "sac"}, "settings='name'"),
        ({"hidden": [0]}, "hidden=0"),
        ({"hidden": [10**9]}, "hidden=1000000000"),
        ({"batch": 10**12}, "batch=1000000000000"),
        ({"replay": 10**12}, "replay of sac cannot be created"),
        ({"random_steps": 4}, r"random_steps=4 is not valid: expected 0 to 0, .*env_steps=4"),
    ],
)
def test_impossible_settings_are_refused(tmp_path, settings, message):
    settings = {"num_envs": 4, "env_steps": 4, "part": 4, "random_steps": 0, **settings}
    with pytest.raises(InvalidArgumentError, match=message):
        Training(*find_preset("sac", "night", "straighten_rope", **settings), [0], tmp_path, "host")
