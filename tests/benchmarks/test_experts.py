"""`benchmarks.experts`: rounds, scores of one code only, and what is kept of old ones."""

import json

import pytest

from benchmarks import experts
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.storage.files import read_json
from softgym_mj.storage.store import JSON, Store


def set_of(code, stride, value=0.5):
    scores = {str(v): value for v in range(800, 1000, stride)}
    return {"code": code, "scores": scores}


def test_a_round_goes_variation_by_variation():
    one = experts.as_round("spread_cloth,fold_cloth:franka,ur5e:80")
    assert list(one.episodes()) == [
        (task, actor, v)
        for v in (800, 880, 960)
        for task in ("spread_cloth", "fold_cloth")
        for actor in ("franka", "ur5e")
    ]
    assert len(list(experts.as_round("all:all:1").episodes())) == len(experts.TASKS) * 4 * 200


@pytest.mark.parametrize(
    "text", ["fold_cloth", "fold_cloth:franka:0", "folds:franka:1", "all:me:1"]
)
def test_other_rounds_are_refused(text):
    with pytest.raises(InvalidArgumentError, match="round="):
        experts.as_round(text)


def test_a_set_is_of_evenly_spaced_variations():
    scores = {v: float(v) for v in [*range(800, 1000, 8), 801, 804, 812]}
    assert experts.evenly(scores) == {v: float(v) for v in range(800, 1000, 8)}
    assert experts.evenly(scores | {v: float(v) for v in range(800, 1000, 4)}) == {
        v: float(v) for v in range(800, 1000, 4)
    }
    assert experts.evenly({v: 1.0 for v in range(800, 850)}) == {}


def test_old_scores_stay_unless_new_ones_are_no_fewer():
    old = {
        "fold_cloth": {"franka": set_of(None, 1), "sawyer": set_of(None, 40)},
        "drop_cloth": {"default": set_of(None, 1)},
    }
    new = {
        "fold_cloth": {
            "franka": set_of("b", 8, 0.9),
            "sawyer": set_of("b", 8),
            "ur5e": set_of("b", 8),
        },
        "pour_water": {"default": set_of("b", 40)},
    }
    both = experts.merged(old, new)
    assert both["fold_cloth"]["franka"] is old["fold_cloth"]["franka"]
    assert both["fold_cloth"]["sawyer"] is new["fold_cloth"]["sawyer"]
    assert both["fold_cloth"]["ur5e"] is new["fold_cloth"]["ur5e"]
    assert both["drop_cloth"] == old["drop_cloth"] and both["pour_water"] == new["pour_water"]
    # As many of other code: the new ones, whole.
    again = experts.merged(both, {"fold_cloth": {"franka": set_of("c", 1, 0.7)}})
    assert again["fold_cloth"]["franka"] == set_of("c", 1, 0.7)


def test_the_code_is_what_scores_depend_on(tmp_path):
    for name in ("robots", "learning"):
        (tmp_path / name).mkdir()
    files = [tmp_path / n for n in ("robots/hand.py", "robots/hand.md", "learning/sac.py")]
    for file in files:
        file.write_text("1")
    first = experts.code_sha256(tmp_path)
    for file, counts in zip(files, (True, False, False), strict=True):
        file.write_text("2")
        assert (experts.code_sha256(tmp_path) != first) == counts
        file.write_text("1")
    (tmp_path / "robots" / "arm.xml").write_text("1")
    assert experts.code_sha256(tmp_path) != first


def test_it_goes_on_and_merges(tmp_path, monkeypatch):
    played = []

    def play(task, actor, variation):
        played.append((task, actor, variation))
        if len(played) == 7:
            raise KeyboardInterrupt
        return {"score": variation / 1000, "core_s": 1.0}

    monkeypatch.setattr(experts, "play", play)
    monkeypatch.setattr(experts, "code_sha256", lambda: "now")
    out = tmp_path / "experts.json"
    out.write_text(json.dumps({"fold_cloth": {"sawyer": set_of(None, 1)}}))
    command = ["fold_cloth:franka,sawyer:20", "--folder", str(tmp_path), "--out", str(out)]
    with pytest.raises(KeyboardInterrupt):
        experts.main(command)
    experts.main([*command, "--collect"])  # Three variations of each are too few.
    assert read_json(out) == {"fold_cloth": {"sawyer": set_of(None, 1)}}
    experts.main(command)
    assert len(played) == 7 + 20 - 6 and len(set(played)) == 20
    found = read_json(out)["fold_cloth"]
    assert found["sawyer"] == set_of(None, 1)
    expected = {str(v): v / 1000 for v in range(800, 1000, 20)}
    assert found["franka"] == {"code": "now", "scores": expected}
    # Scores of other code are in a folder of their own.
    monkeypatch.setattr(experts, "code_sha256", lambda: "later")
    assert experts.collected(Store(tmp_path / "later", {"code": "later"}, JSON), "later") == {}


@pytest.mark.slow
def test_processes_play_what_one_plays(tmp_path):
    scores = []
    for jobs in ("1", "2"):
        folder, out = tmp_path / jobs, tmp_path / f"{jobs}.json"
        experts.main(
            ["straighten_rope:ur5e:40", "--jobs", jobs, "--folder", str(folder), "--out", str(out)]
        )
        scores.append(read_json(out))
    assert scores[0] == scores[1] and len(scores[0]["straighten_rope"]["ur5e"]["scores"]) == 5
