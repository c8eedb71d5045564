"""The folder of an evaluation: whose it is, and what can be added to it."""

import concurrent.futures
import dataclasses
import hashlib
import multiprocessing

import pytest

from softgym_mj.evaluation import Configuration, Progress, evaluate
from softgym_mj.exceptions import StoreError, UnexpectedArgumentError
from tests.policies.test_saved_policies import exported

SHORT = {"horizon": 6}
SIMPLE = Configuration("straighten_rope", "random", (800, 801, 802), (0, 1), SHORT)


def test_a_folder_belongs_to_one_configuration(tmp_path):
    evaluate(SIMPLE, tmp_path)
    other = dataclasses.replace(SIMPLE, settings={"horizon": 7})
    with pytest.raises(
        StoreError, match=r"different settings: choose a new folder, such as --out .*_2, or delete"
    ):
        evaluate(other, tmp_path)


def test_damage_is_an_error_and_not_played_again(tmp_path):
    evaluate(SIMPLE, tmp_path)
    first, second = sorted((tmp_path / "episodes").glob("080*"))[:2]
    first.write_bytes(second.read_bytes())
    played = Progress(on_episode=pytest.fail)
    with pytest.raises(StoreError, match=rf"{first.name} cannot be read"):
        evaluate(SIMPLE, tmp_path, None, played)
    (tmp_path / "provenance.json").write_text("{")
    with pytest.raises(StoreError, match=r"provenance\.json cannot be read"):
        evaluate(SIMPLE, tmp_path, None, played)


def test_provenance_of_another_evaluation_is_an_error(tmp_path):
    one = dataclasses.replace(SIMPLE, variations=(800,), seeds=(0,))
    for name, configuration in (("a", one), ("b", dataclasses.replace(one, settings={}))):
        evaluate(configuration, tmp_path / name)
    (tmp_path / "b" / "provenance.json").replace(tmp_path / "a" / "provenance.json")
    with pytest.raises(StoreError, match=r"provenance\.json belongs to another evaluation"):
        evaluate(one, tmp_path / "a")


def test_a_folder_goes_on_with_other_variations_and_seeds(tmp_path):
    first = evaluate(dataclasses.replace(SIMPLE, variations=(801, 800), seeds=(1,)), tmp_path / "a")
    assert evaluate(SIMPLE, tmp_path / "a") == evaluate(SIMPLE, tmp_path / "b")
    assert evaluate(SIMPLE, tmp_path / "a")["episodes"][3] == first["episodes"][1]
    whole = (tmp_path / "a" / "result.json").read_bytes()
    assert whole == (tmp_path / "b" / "result.json").read_bytes()


@pytest.mark.long
def test_processes_share_a_folder(tmp_path):
    several = [dataclasses.replace(SIMPLE, variations=own) for own in ((800, 802), (801,))]
    with concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(evaluate, several, [tmp_path / "a"] * 2))
    assert evaluate(SIMPLE, tmp_path / "a") == evaluate(SIMPLE, tmp_path / "b")


def test_a_failed_evaluation_leaves_its_folder_free(tmp_path):
    with pytest.raises(UnexpectedArgumentError):
        evaluate(dataclasses.replace(SIMPLE, settings={"color": "red"}), tmp_path)
    assert evaluate(SIMPLE, tmp_path)["settings"] == SHORT


def test_a_changed_policy_needs_another_folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    module, folder = tmp_path / "changing.py", tmp_path / "run"
    module.write_text("from tests.policies.test_saved_policies import constant\n")
    configuration = Configuration("straighten_rope", "changing:constant", (800,), (0,), SHORT)
    result = evaluate(configuration, folder)
    sha = hashlib.sha256(module.read_bytes()).hexdigest()
    assert result["policy_sha256"] == {"changing:constant": sha}
    evaluate(configuration, folder)
    module.write_text("from tests.policies.test_saved_policies import broken as constant\n")
    with pytest.raises(StoreError, match="different content of changing:constant"):
        evaluate(configuration, folder)


def test_a_file_for_each_seed(tmp_path):
    name, folder = str(tmp_path / "run_{seed}.pt2"), tmp_path / "run"
    for seed in range(2):
        exported(tmp_path / f"run_{seed}.pt2", seed=seed)
    one = Configuration("straighten_rope", name, (800,), (0,), {"horizon": 30})
    first = evaluate(one, folder, trust=True)
    result = evaluate(dataclasses.replace(one, seeds=(0, 1)), folder, trust=True)
    assert len({episode["return"] for episode in result["episodes"]}) >= 2  # One misses the rope.
    assert result["episodes"][0] == first["episodes"][0]
    assert list(result["policy_sha256"]) == [name.replace("{seed}", str(i)) for i in range(2)]
    exported(tmp_path / "run_1.pt2", seed=7)
    assert evaluate(one, folder)["seeds"] == [0]
    with pytest.raises(StoreError, match=r"different content of .*run_1\.pt2:"):
        evaluate(dataclasses.replace(one, seeds=(0, 1)), folder)


@pytest.mark.parametrize("name", ["run_{seed}.pt2", "run_0.pt2"])
def test_a_file_that_was_moved_is_the_same_policy(name, tmp_path):
    here, there, folder = tmp_path / "here", tmp_path / "there", tmp_path / "run"
    here.mkdir()
    for seed in range(2):
        exported(here / f"run_{seed}.pt2", seed=seed)
    seeds = (0, 1) if "{seed}" in name else (0,)
    one = Configuration("straighten_rope", str(here / name), (800,), seeds, SHORT)
    first = evaluate(one, folder, trust=True)
    here.rename(there)
    moved = dataclasses.replace(one, policy=str(there / name))
    never = Progress(on_step=pytest.fail)
    again = evaluate(moved, folder, None, never)  # Plays nothing: it is not trusted.
    assert again["episodes"] == first["episodes"] and again["policy"] == str(there / name)
    more = evaluate(dataclasses.replace(moved, variations=(800, 801)), folder, trust=True)
    new = evaluate(dataclasses.replace(moved, variations=(800, 801)), tmp_path / "b", trust=True)
    assert more["episodes"] == new["episodes"]
    exported(there / "run_0.pt2", seed=7)
    with pytest.raises(StoreError, match=r"different policy \('.*here.*', not '.*there.*'\)"):
        evaluate(moved, folder, None, never)


def test_a_moved_file_of_another_seed_is_another_policy(tmp_path):
    for seed in range(2):
        exported(tmp_path / f"one_{seed}.pt2", seed=seed)
        exported(tmp_path / f"two_{seed}.pt2", seed=seed)
    one = Configuration("straighten_rope", str(tmp_path / "one_{seed}.pt2"), (800,), (0,), SHORT)
    evaluate(one, tmp_path / "run", trust=True)
    for name, seeds in (("two_{seed}.pt2", (1,)), ("two_1.pt2", (0,))):
        other = dataclasses.replace(one, policy=str(tmp_path / name), seeds=seeds)
        with pytest.raises(StoreError, match="different policy"):
            evaluate(other, tmp_path / "run")
