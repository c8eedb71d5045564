"""When the starts of variations are read for a batch."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.vector.batch import episodes, initial_states
from softgym_mj.vector.batch.cloth import ClothBatch

MANY = 8


@pytest.fixture(autouse=True)
def _many(monkeypatch):
    """Eight environments count as many, and this process reads all starts, as on one core."""
    monkeypatch.setattr(initial_states, "MANY", MANY)
    monkeypatch.setattr(episodes, "MANY", MANY)
    monkeypatch.setattr(initial_states, "num_cores", lambda: 1)


def _make(number, horizon=2):
    split = [*range(2 * MANY)]
    return softgym_mj.make_vec(
        "straighten_rope", number, device="host", split=split, horizon=horizon, fidelity="fast"
    )


def _play(envs):
    """Some episodes of each, which end in the same step."""
    found = []
    for _ in range(8):
        *_, infos = envs.step(np.zeros((envs.num_envs, 8)))
        found.append(infos["variation"])
    return np.unique(found)


def test_many_environments_read_all_that_they_may_draw_before_their_first_step(monkeypatch):
    envs = _make(MANY)
    envs.reset(seed=0)
    monkeypatch.setattr(
        initial_states, "read", lambda *_: pytest.fail("a start was read in a step")
    )
    assert len(_play(envs)) > MANY
    envs.close()


def test_few_environments_and_given_variations_read_what_they_play(monkeypatch):
    read, seen = initial_states.read, []

    def noted(env, *others):
        seen.append(env.task.variation)
        return read(env, *others)

    monkeypatch.setattr(initial_states, "read", noted)
    envs = _make(3)
    envs.reset(seed=0)
    assert len(seen) <= 3
    envs.close()
    envs, seen[:] = _make(MANY), []
    envs.reset(options={"variation": [i % 5 for i in range(MANY)]})
    assert sorted(seen) == [*range(5)]
    envs.close()


def test_a_process_keeps_one_environment_that_reads_starts(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path))  # No start is stored.
    initial_states._opened.cache_clear()
    for horizon in (2, 3):
        envs = _make(MANY, horizon)
        envs.reset(seed=0)  # Reads all of the split, in two calls.
        envs.close()
    found = initial_states._opened.cache_info()
    assert (found.misses, found.hits, found.currsize) == (2, 2, 1)


def test_distances_of_all_meshes_stay_where_they_are_found():
    """Distances of vertices of several meshes equal those of each mesh alone."""
    envs = softgym_mj.make_vec("fold_cloth", 5, device="host", split="train", fidelity="fast")
    envs.reset(options={"variation": [*range(5)]})
    physics = envs.backend._physics
    assert isinstance(physics, ClothBatch)
    first = physics.state["pairs_at"]
    assert len({*first.tolist()}) == 5
    pairs = ((3, 7), (7, 3), (20, 20), (0, 30))
    found = [physics._distances.between(first, np.full(5, a), np.full(5, b)) for a, b in pairs]
    env = softgym_mj.load("fold_cloth", split="train", fidelity="fast")
    for i in range(5):
        env.reset(i)
        alone = env.task.flexes.flexes[0].mesh_distances
        assert [each[i] for each in found] == [alone.between(a, b) for a, b in pairs]
    envs.close()
