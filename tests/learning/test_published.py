"""Published policies are the files of their cards and reach their scores."""

import hashlib
import json
import pathlib

import numpy as np
import pytest

import softgym_mj
from softgym_mj.policies.episodes import play
from softgym_mj.policies.exported import observes

FOLDER = pathlib.Path(__file__).parents[2] / "docs" / "results" / "policies"
VARIATIONS = (820, 860, 900, 940)
ERRORS = 4.0  # Standard errors of so few episodes that scores may differ by.


CARDS = {file.stem: json.loads(file.read_text()) for file in sorted(FOLDER.glob("*.json"))}
# One that sees states and one that sees images, of the task that takes least time to play.
SHORT = {"straighten_rope-sac", "straighten_rope-teacher_student"}


@pytest.mark.parametrize("name", CARDS)
def test_a_policy_is_that_of_its_card(name):
    own = CARDS[name]["policy"]
    assert hashlib.sha256((FOLDER / own["file"]).read_bytes()).hexdigest() == own["sha256"]
    actor = observes(str(FOLDER / own["file"])).get("actor")
    assert actor == CARDS[name]["training"].get("actor")


@pytest.mark.parametrize(
    "card",
    [
        pytest.param(card, id=name, marks=() if name in SHORT else pytest.mark.long)
        for name, card in CARDS.items()
    ],
)
def test_a_policy_does_what_its_card_says(card):
    own = card["policy"]
    file = FOLDER / own["file"]
    held_out = (row for row in card["last"] if row["split"] == "evaluate")
    (last,) = (row for row in held_out if row["seed"] == own["seed"])
    env = softgym_mj.load(last["task"], split="all", **observes(str(file)))
    scores = [
        play(env, str(file), variation, trust=True, camera=None).info["normalized_performance"][-1]
        for variation in VARIATIONS
    ]
    margin = ERRORS * own["deviation"] / np.sqrt(len(VARIATIONS))
    assert abs(np.mean(scores) - last["normalized_performance"]) < margin
