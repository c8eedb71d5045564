"""Memory of a process that makes one environment after another."""

import gc
import weakref

import pytest

import softgym_mj
from softgym_mj.envs import discarded


@pytest.mark.parametrize("close", [False, True])
def test_few_discarded_environments_wait_for_the_collector(close):
    gc.collect()
    tasks: weakref.WeakSet = weakref.WeakSet()
    most = 0
    for _ in range(4 * discarded.MOST_WAITING):
        env = softgym_mj.load("straighten_rope", split=[0])
        tasks.add(env.task)
        most = max(most, len(tasks))
        if close:
            env.close()
        del env
    assert most <= discarded.MOST_WAITING + 1


def test_a_process_that_disabled_the_collector_keeps_it_disabled(monkeypatch):
    monkeypatch.setattr(discarded, "_waiting", discarded.MOST_WAITING)
    monkeypatch.setattr(gc, "collect", lambda: pytest.fail("gc.collect was called"))
    gc.disable()
    try:
        softgym_mj.load("straighten_rope", split=[0])
    finally:
        gc.enable()
