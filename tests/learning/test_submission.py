"""`learning submit`: scores of other code's policies, against episodes played one by one."""

import json
import shutil

import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.learning import results, submission
from softgym_mj.learning.results import Name, Row
from softgym_mj.variations.indices import SPLITS
from tests.command import output_of

FEW = {"train": range(1), "evaluate": range(800, 802)}
OWN = Name("straighten_rope", "default", "mine", "reduced", "custom", "plain")
SIZE = 36  # Size of the reduced state of straighten_rope.


class Constant(torch.nn.Module):
    """Moves the first picker, whatever it sees."""

    def __init__(self, speed):
        super().__init__()
        self.speed = speed

    def forward(self, seen):
        action = torch.zeros(8)
        action[0] = self.speed
        return seen[:, :1] * 0.0 + action


@pytest.fixture(name="policies", scope="module")
def _policies(tmp_path_factory):
    """A folder with a policy of each of two seeds."""
    folder = tmp_path_factory.mktemp("policies")
    for seed in range(2):
        exported = torch.export.export(Constant(float(seed)), (torch.zeros(1, SIZE),))
        torch.export.save(exported, folder / f"policy_{seed}.pt2")
    return folder


@pytest.fixture(name="folder")
def _folder(policies, tmp_path):
    return shutil.copytree(policies, tmp_path / "own")


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setattr(submission, "variations", lambda: FEW)


def _write_card(folder, **changes):
    card = {
        "method": "mine", "preset": "custom", "seeds": [0, 1], "evaluations": [100, 200],
        "updates": 50, "seconds": 12.0,
        "training": {"task": "straighten_rope", "observation": "reduced"},
    } | changes  # fmt: skip
    (folder / "card.json").write_text(json.dumps(card))


def _played(speed, variation):
    env = softgym_mj.load("straighten_rope", split="all")
    env.reset(variation)
    action = [speed, *[0.0] * 7]
    while not env.step(action).last():
        pass
    return float(env.info()["normalized_performance"])


def _submit(folder):
    return output_of("learning", "submit", str(folder), "--trust")


def test_as_many_variations_of_training_as_held_out(monkeypatch):
    monkeypatch.undo()
    own = submission.variations()
    assert own["evaluate"] == SPLITS["evaluate"]
    assert len(own["train"]) == 200 and {*own["train"]} < {*SPLITS["train"]}


def test_rows_have_the_actor_of_the_card(folder):
    training = {"task": "straighten_rope", "observation": "reduced", "actor": "franka"}
    _write_card(folder, training=training)
    own = submission.read_submission(folder)
    assert own.name == OWN._replace(actor="franka")
    assert own.configuration.settings == {"observation": "reduced", "actor": "franka"}


def test_rows_of_own_trainings_keep_their_replay(folder):
    for settings, replay in (({"symmetric": True}, "symmetric"), ({}, "plain"), (None, "plain")):
        _write_card(folder, settings=settings)
        assert submission.read_submission(folder).name == OWN._replace(replay=replay)


def test_rows_are_what_episodes_played_one_by_one_score(folder):
    _write_card(folder)
    assert "seed 1: " in _submit(folder)
    rows = {(row.seed, row.split): row for row in results.read_rows(folder / "curve.csv")}
    assert len(rows) == 4
    for (seed, split), row in rows.items():
        scores = [_played(float(seed), variation) for variation in FEW[split]]
        assert row.normalized_performance == pytest.approx(sum(scores) / len(scores), abs=1e-12)
        assert (row.name, row.env_steps, row.updates, row.seconds) == (OWN, 200, 50, 12.0)
        assert row.final and row.episodes == len(FEW[split])
    lines = (folder / "episodes.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * len(FEW["evaluate"])


def test_earlier_rows_stay_and_final_ones_are_replaced(folder):
    _write_card(folder)
    earlier = Row(*OWN, 0, 100, 25, 6.0, "evaluate", 20, 0.4, 0.0, False)
    claimed = Row(*OWN, 0, 200, 50, 12.0, "evaluate", 200, 0.999, 1.0, True)
    results.write_rows([earlier, claimed], folder / "curve.csv")
    _submit(folder)
    rows = results.read_rows(folder / "curve.csv")
    assert earlier in rows and claimed not in rows
    later = Row(*OWN, 0, 300, 75, 18.0, "evaluate", 200, 0.9, 1.0, True)
    results.write_rows([earlier, later], folder / "curve.csv")
    with pytest.raises(StoreError, match=r"a row after the last of card\.json's evaluations"):
        submission.submit(submission.read_submission(folder), trust=True)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": []}, r"seeds=\[\] is not valid"),
        ({"seeds": [0, 7]}, r"no policy_7\.pt2"),
        ({"evaluations": ["100"]}, r"evaluations=\['100'\] is not valid"),
        ({"updates": None}, "updates=None is not valid"),
        ({"seconds": True}, "seconds=True is not valid"),
        ({"training": {"task": "straighten_rope"}}, "training lacks observation"),
    ],
)
def test_cards_that_lack_something_are_refused(folder, changes, message):
    _write_card(folder, **changes)
    with pytest.raises(StoreError, match=message):
        submission.read_submission(folder)


def test_a_task_that_is_none_and_a_policy_without_trust_are_refused(folder):
    _write_card(folder, training={"task": "fold_a_shirt", "observation": "reduced"})
    with pytest.raises(InvalidArgumentError, match="fold_a_shirt"):
        submission.read_submission(folder)
    _write_card(folder)
    with pytest.raises(InvalidArgumentError, match="trust"):
        submission.submit(submission.read_submission(folder))
