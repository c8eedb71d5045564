"""Policies that are published are those of their cards, and do what these say."""

import hashlib
import json
import pathlib

import numpy as np
import pytest

import softgym_mj
from softgym_mj.policies.episodes import play
from softgym_mj.policies.exported import observes

FOLDER = pathlib.Path(__file__).parents[2] / "docs" / "results" / "policies"
VARIATIONS = (800, 850, 900, 950)
ERRORS = 4.0  # Standard errors of so few episodes that scores may differ by.


@pytest.mark.parametrize("card", sorted(FOLDER.glob("*.json")), ids=lambda file: file.stem)
def test_a_policy_does_what_its_card_says(card):
    content = json.loads(card.read_text())
    own = content["policy"]
    file = FOLDER / own["file"]
    assert hashlib.sha256(file.read_bytes()).hexdigest() == own["sha256"]
    held_out = (row for row in content["last"] if row["split"] == "evaluate")
    (last,) = (row for row in held_out if row["seed"] == own["seed"])
    env = softgym_mj.load(last["task"], split="all", **observes(str(file)))
    scores = [
        play(env, str(file), variation, trust=True, camera=None).info["normalized_performance"][-1]
        for variation in VARIATIONS
    ]
    margin = ERRORS * own["deviation"] / np.sqrt(len(VARIATIONS))
    assert abs(np.mean(scores) - last["normalized_performance"]) < margin
