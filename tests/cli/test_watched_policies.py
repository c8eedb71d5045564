"""Commands that show a policy play it in what it was trained with."""

import json
import pathlib

import pytest

import softgym_mj
from softgym_mj.cli import view
from softgym_mj.policies.episodes import play
from softgym_mj.policies.exported import observes
from tests.command import output_of

POLICIES = pathlib.Path(__file__).parents[2] / "docs" / "results" / "policies"


def test_rollouts_score_as_evaluations_do():
    file = str(POLICIES / "straighten_rope-distill_rgb.pt2")
    command = f"rollout straighten_rope --policy {file} --trust --variations 800"
    (line,) = output_of(*command.split()).splitlines()
    env = softgym_mj.load("straighten_rope", split="evaluate", **observes(file))
    info = play(env, file, 800, trust=True).info
    assert json.loads(line)["normalized_performance"] == info["normalized_performance"][-1]


@pytest.mark.parametrize("name", ["fold_cloth-sac", "fold_cloth-franka-sac"])
def test_viewers_play_saved_policies(monkeypatch, name):
    opened = []

    class Opened(Exception):
        """Ends the command."""

    def session(*arguments, **settings):
        opened.append((arguments, settings))
        raise Opened

    monkeypatch.setattr(view, "Session", session)
    file = str(POLICIES / f"{name}.pt2")
    with pytest.raises(Opened):
        view.view("fold_cloth", file, trust=True, browser=True, port=0)
    ((_, policy, _), settings) = opened[0]
    assert policy == file
    assert settings.pop("trust") is True and settings == observes(file)
    assert settings["observation"] == "markov"
