"""Recorded datasets load back and play again bit-equal; what they hold and say."""

import re
import warnings

import gymnasium
import h5py
import minari
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.episodes import play
from softgym_mj.recording import dataset_name, record
from softgym_mj.recording.minari_format import chunk
from softgym_mj.variations.indices import SPLITS

pytestmark = pytest.mark.usefixtures("own_datasets")


@pytest.mark.parametrize(
    ("task", "variations", "settings"),
    [
        ("straighten_rope", (800, 801), {"observation": "reduced"}),
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


def test_images_are_compressed_without_loss(tmp_path):
    settings = {"observation": ["reduced", "rgb", "depth"], "image_size": (64, 96), "horizon": 15}
    dataset = record("straighten_rope", (800,), dataset="rope/seen-v0", **settings)
    (episode,), env = dataset, softgym_mj.load("straighten_rope", split="all", **settings)
    timestep = env.reset(800)
    for k in range(16):
        for name in ("rgb", "depth"):
            np.testing.assert_array_equal(
                episode.observations[name][k], timestep.observation[name], strict=True
            )
        timestep = env.step(episode.actions[k]) if k < 15 else None
    with h5py.File(tmp_path / "rope" / "seen-v0" / "data" / "main_data.hdf5") as file:
        for name, shape in (("rgb", (16, 3, 96, 3)), ("depth", (16, 2, 96))):
            kept = file["episode_0/observations"][name]
            assert kept.chunks == shape and kept.id.get_storage_size() < 0.2 * kept.nbytes


@pytest.mark.parametrize(
    ("shape", "kind", "expected"),  # A frame has 1024 bytes or less.
    [
        ((76, 128, 128, 3), np.uint8, (76, 2, 128, 3)),
        ((76, 2, 128, 128, 3), np.uint8, (76, 1, 2, 128, 3)),
        ((76, 1024, 4), np.float32, (76, 64, 4)),
        ((76, 480, 480, 3), np.uint8, (76, 1, 341, 3)),
        ((76, 8, 8), np.float32, (76, 8, 8)),
    ],
)
def test_chunks_are_stripes_through_time(shape, kind, expected):
    assert chunk(np.empty(shape, kind)) == expected


def test_bad_input_is_refused():
    for bad, message in (
        (("fly", (800,)), "task='fly'"),
        (("straighten_rope", (800,), "best"), "policy='best'"),
        (("straighten_rope", (1000,)), "variation=1000"),
        (("straighten_rope", ()), r"variations=\[\] .*at least one"),
        (("straighten_rope", (1, 2, 1)), r"variations=\[1, 2, 1\] .*each of them once"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            record(*bad)


def test_default_ids_tell_what_acts():
    assert dataset_name("fold_cloth", "scripted") == "softgym_mj/fold_cloth/scripted-v0"
    ids = [
        dataset_name("lift", "pol.py:make", *acts) for acts in ((), ("franka",), ("franka", "a"))
    ]
    stem = "softgym_mj/lift/pol-py-make"
    assert ids == [f"{stem}-v0", f"{stem}-franka-v0", f"{stem}-franka-a-v0"]


@pytest.mark.parametrize(
    ("variations", "split"), [((0, 799), "train"), ((800, 999), "evaluate"), ((799, 800), "all")]
)
def test_recovered_environments_draw_from_their_splits(variations, split):
    dataset = record("straighten_rope", variations, "zero", horizon=1)
    for settings, name in (({}, split), ({"eval_env": True}, "evaluate")):
        env = dataset.recover_environment(**settings)
        assert list(env.unwrapped.dm_env.variations) == list(SPLITS[name])
        assert env.reset(seed=0)[1]["variation"] in SPLITS[name]
        assert env.reset(options={"variation": 900})[1]["variation"] == 900  # Any can be asked for.


@pytest.mark.parametrize("name", ["bad name", "rope/expert", "../rope-v0", ""])
def test_a_bad_id_is_refused_before_anything_is_played(name, tmp_path):
    with pytest.raises(
        InvalidArgumentError, match=re.escape(f"dataset={name!r}") + ".*'rope/expert-v0'"
    ):
        record("straighten_rope", (800,), "zero", dataset=name, on_episode=pytest.fail)
    assert not list(tmp_path.iterdir()) and not list(tmp_path.parent.glob("rope*"))


def test_a_folder_that_is_no_dataset_is_in_nobodys_way(tmp_path):
    (tmp_path / "bad name" / "data").mkdir(parents=True)
    dataset = record("straighten_rope", (800,), "zero", dataset="rope/zero-v0", horizon=3)
    assert dataset.total_episodes == 1


def test_only_successful_episodes():
    flags = {}

    def on_episode(info):
        flags[int(info["variation"])] = bool(info["success"])

    variations = (892, 893, 894)
    dataset = record(
        "straighten_rope", variations, successful_only=True, on_episode=on_episode, horizon=20
    )
    env = softgym_mj.load("straighten_rope", horizon=20)
    played = {variation: play(env, "scripted", variation, camera=None) for variation in variations}
    scores = {v: episode.info["normalized_performance"] for v, episode in played.items()}
    threshold = env.task.success
    expected = [variation for variation in variations if scores[variation][-1] >= threshold]
    assert 0 < len(expected) < len(variations)
    assert [variation for variation, success in flags.items() if success] == expected
    assert [int(episode.infos["variation"][0]) for episode in dataset] == expected
    assert [episode.id for episode in dataset] == list(range(len(expected)))
    assert dataset.storage.metadata["description"].endswith(
        f" straight. {len(expected)} of 3 episodes, those with success."
    )
    # The score of an episode is in the infos; returns have no reference scores. Recorded actions
    # are of single precision.
    for episode, variation in zip(dataset, expected, strict=True):
        result = episode.infos["normalized_performance"]
        np.testing.assert_allclose(result, scores[variation], atol=1e-6)
    with pytest.raises(ValueError, match="Reference score not provided"):
        minari.get_normalized_score(dataset, np.zeros(1))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_idle_steps_are_dropped(noise):
    (whole,), (short,) = (
        record("straighten_rope", (800,), noise=noise, dataset=f"rope/{idle}-v0", idle=idle)
        for idle in ("keep", "drop")
    )
    count = len(short.actions)
    assert 10 < count < (1.0 if noise else 0.5) * len(whole.actions)
    for part in ("actions", "rewards"):
        np.testing.assert_array_equal(getattr(short, part), getattr(whole, part)[:count])
    if noise:
        labels = whole.infos["expert_action"][:count]
        np.testing.assert_array_equal(short.infos["expert_action"], labels)
    assert short.truncations.tolist() == [False] * (count - 1) + [True]
    assert not short.terminations.any()
    for episode in (whole, short):
        assert episode.infos["success"][-1]
    assert short.infos["max_speed"][-1] < 0.01


@pytest.mark.parametrize(("idle", "policy"), [("skip", "scripted"), ("drop", "zero")])
def test_idle_steps_are_dropped_only_where_the_policy_tells(idle, policy):
    with pytest.raises(InvalidArgumentError, match=rf"idle='{idle}'.*'keep'"):
        record("straighten_rope", (800,), policy, dataset="rope/idle-v0", idle=idle)


def test_no_success_is_an_error_that_keeps_the_episodes(tmp_path):
    arguments = {"policy": "zero", "dataset": "rope/zero-v0", "horizon": 3}
    with pytest.raises(
        InvalidArgumentError, match=r"successful_only=True .*none of the 2 episodes"
    ):
        record("straighten_rope", (800, 801), successful_only=True, **arguments)
    assert len(list(tmp_path.rglob("*.value"))) == 2
    assert record("straighten_rope", (800, 801), **arguments).total_episodes == 2


def test_who_made_a_dataset():
    names = {"author": "A. Author", "author_email": "a@b.org", "code_permalink": "https://b.org/1"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = record("straighten_rope", (800,), "zero", dataset="one-v0", horizon=3)
        signed = record("straighten_rope", (800,), "zero", dataset="two-v0", horizon=3, **names)
    assert not set(names) & set(dataset.storage.metadata)
    metadata = signed.storage.metadata
    assert metadata["author"] == {"A. Author"} and metadata["author_email"] == {"a@b.org"}
    assert metadata["code_permalink"] == "https://b.org/1"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"split": "all"}, "settings=.*not 'split'"),
        ({"random_state": 3}, "settings=.*not 'random_state'"),
        ({"image_size": (np.int64(16),) * 2}, "settings=.*that JSON can store"),
    ],
)
def test_settings_that_a_dataset_cannot_have(settings, message):
    with pytest.raises(InvalidArgumentError, match=message):
        record("straighten_rope", (800,), "zero", on_episode=pytest.fail, **settings)
