"""Recorded datasets load back and play again bit-equal."""

import gymnasium
import minari
import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj import cli
from softgym_mj.exceptions import DatasetExistsError, OutOfRangeError, UnknownNameError
from softgym_mj.recording import dataset_name, record


@pytest.fixture(autouse=True)
def _own_datasets(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))


@pytest.mark.parametrize(
    ("task", "variations", "settings"),
    [
        ("straighten_rope", range(800, 810), {"observation": "reduced"}),
        ("transport_water", (800, 805), {"observation": ["reduced", "rgb"], "image_size": (16, 16),
                                         "fidelity": "fast", "horizon": 8}),
    ],
)  # fmt: skip
def test_a_dataset_plays_again_bit_equal(task, variations, settings):
    scores = []
    record(task, variations, on_episode=lambda i: scores.append(i["performance"]), **settings)
    dataset = minari.load_dataset(dataset_name(task, "scripted"))
    assert dataset.total_episodes == len(variations)
    env = dataset.recover_environment()
    assert isinstance(env, gymnasium.Env)
    for episode, score in zip(dataset.iterate_episodes(), scores, strict=True):
        variation = int(episode.infos["variation"][0])
        observation, _ = env.reset(options={"variation": variation})
        recorded = episode.observations
        if isinstance(recorded, dict):
            recorded = [
                dict(zip(recorded, parts, strict=True))
                for parts in zip(*recorded.values(), strict=True)
            ]
        for i, action in enumerate(episode.actions):
            np.testing.assert_equal(observation, recorded[i])
            observation, reward, *_, info = env.step(action)
            assert reward == episode.rewards[i]
        np.testing.assert_equal(observation, recorded[-1])
        assert info["performance"] == score == episode.infos["performance"][-1]
        assert episode.truncations[-1] and not episode.terminations.any()


def test_a_taken_name_and_bad_input_are_refused():
    record("straighten_rope", (800,), "zero", dataset="mine/rope-v0", horizon=3)
    with pytest.raises(DatasetExistsError, match=r"dataset='mine/rope-v0' exists.*minari delete"):
        record("straighten_rope", (800,), "zero", dataset="mine/rope-v0", horizon=3)
    with pytest.raises(UnknownNameError, match="task='fly'"):
        record("fly", (800,))
    with pytest.raises(UnknownNameError, match="policy='best'"):
        record("straighten_rope", (800,), "best")
    with pytest.raises(OutOfRangeError, match="variation=1000"):
        record("straighten_rope", (1000,))


def test_default_ids_tell_what_acts():
    assert dataset_name("fold_cloth", "scripted") == "softgym_mj/fold_cloth/scripted-v0"
    ids = [
        dataset_name("lift", "pol.py:make", *acts) for acts in ((), ("franka",), ("franka", "a"))
    ]
    stem = "softgym_mj/lift/pol-py-make"
    assert ids == [f"{stem}-v0", f"{stem}-franka-v0", f"{stem}-franka-a-v0"]


def test_the_command_line_records():
    command = "record straighten_rope --policy random --episodes 2 --seed 3"
    output = CliRunner().invoke(cli.app, command.split())
    assert output.exit_code == 0, output.output
    dataset = minari.load_dataset("softgym_mj/straighten_rope/random-v0")
    first, second = dataset.iterate_episodes()
    assert len(first) == len(second) == 75
    assert not np.array_equal(first.actions, second.actions)
