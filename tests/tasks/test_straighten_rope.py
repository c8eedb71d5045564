"""The start states of straighten_rope that its docstring counts."""

import numpy as np

import softgym_mj
from softgym_mj.tasks import straighten_rope
from softgym_mj.variations.indices import SPLITS


def test_starts_that_count_as_success():
    """The docstring has the right number; a reset of one reports success."""
    env = softgym_mj.load("straighten_rope", split="all")
    starts = [env.task.store.load(index) for index in SPLITS["all"]]
    gaps = np.array([np.linalg.norm(points[0] - points[-1]) for points in starts])
    successes = np.flatnonzero(
        1.0 - abs(gaps - 0.5) / 0.5 >= straighten_rope.StraightenRope.success
    )
    found = successes.size, np.isin(successes, SPLITS["evaluate"]).sum()
    text = " ".join(straighten_rope.StraightenRope.__doc__.split())
    assert f"In {found[0]} of the 1000 variations, {found[1]} of the 200 of `evaluate`" in text
    for index in (successes[0], successes[0] - 1):
        env.reset(int(index))
        info = env.info()
        assert info["success"] == info["is_success"] == (index in successes)
