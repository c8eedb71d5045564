"""The folder of an evaluation: whose it is, and what can be added to it."""

import concurrent.futures
import dataclasses
import hashlib
import multiprocessing

import pytest

from softgym_mj.evaluation import Configuration, Planning, Progress, evaluate
from softgym_mj.exceptions import StoreError, UnexpectedArgumentError
from tests.policies.test_saved_policies import exported
from tests.storage.test_files import odd

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


def swap(file, other):
    """Has two files change places."""
    content, others = file.read_bytes(), other.read_bytes()
    file.write_bytes(others)
    other.write_bytes(content)


def test_files_know_whose_they_are(tmp_path):
    """Episodes, journals and provenance in the place of others: swapped, or as links."""
    planned = Configuration(
        "straighten_rope", "icem", (800, 801), (0, 1), SHORT, Planning(2, 40, 2, replan_every=2)
    )
    folder = tmp_path / "a"
    before = evaluate(planned, folder)
    one = dataclasses.replace(planned, variations=(800,), seeds=(0,))
    for settings in ({"horizon": 7}, {"num_pickers": 1, **SHORT}):
        evaluate(dataclasses.replace(one, settings=settings), tmp_path / str(len(settings)))
    names = ["episodes/0800_0000.value", "episodes/0801_0000.value", "episodes/0800_0001.value"]
    for name in names:
        (folder / name).with_suffix(".jsonl").unlink()
    files = [folder / name for name in names]
    # Results of another variation, of another seed, of other settings.
    for file, other in [(files[0], files[1]), (files[0], files[2])] + [
        (files[0], tmp_path / f"{n}" / names[0]) for n in (1, 2)
    ]:
        swap(file, other)
        with pytest.raises(StoreError, match=r"\.value cannot be read: it begins"):
            evaluate(planned, folder)
        swap(file, other)
        kept = file.rename(file.with_suffix(".kept"))
        for link in (file.symlink_to, file.hardlink_to):
            link(other)
            with pytest.raises(StoreError, match=r"\.value cannot be read: it begins"):
                evaluate(planned, folder)
            file.unlink()
        kept.rename(file)
    swap(folder / "provenance.json", tmp_path / "1" / "provenance.json")
    with pytest.raises(StoreError, match=r"provenance\.json belongs to another evaluation"):
        evaluate(planned, folder)
    swap(folder / "provenance.json", tmp_path / "1" / "provenance.json")
    assert evaluate(planned, folder) == before


@pytest.mark.parametrize("name", ["provenance.json", "episodes/0800_0000.value"])
@pytest.mark.parametrize("kind", ["pipe", "socket", "folder", "device"])
def test_a_folder_of_odd_files(name, kind, tmp_path):
    single = dataclasses.replace(SIMPLE, variations=(800,), seeds=(0,))
    evaluate(single, tmp_path)
    (tmp_path / name).unlink()
    odd(kind, tmp_path / name)
    with pytest.raises(StoreError, match=rf"{name} cannot be read: "):
        evaluate(single, tmp_path)


def test_a_folder_goes_on_with_other_variations_and_seeds(tmp_path):
    first = evaluate(dataclasses.replace(SIMPLE, variations=(801, 800), seeds=(1,)), tmp_path / "a")
    assert evaluate(SIMPLE, tmp_path / "a") == evaluate(SIMPLE, tmp_path / "b")
    assert evaluate(SIMPLE, tmp_path / "a")["episodes"][3] == first["episodes"][1]
    whole = (tmp_path / "a" / "result.json").read_bytes()
    assert whole == (tmp_path / "b" / "result.json").read_bytes()


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
