"""Random numbers of tests: the same in each run, without a seed too."""

import gymnasium
import numpy as np
import pytest

DRAWN = []


@pytest.mark.parametrize("time", ["first", "second"])
def test_generators_without_a_seed_draw_the_same_again(time):
    space = gymnasium.spaces.Box(0.0, 1.0, (2,))
    own = np.random.default_rng().random(), np.random.RandomState().rand(), *space.sample()
    DRAWN.append((*own, np.random.rand()))  # noqa: NPY002
    assert len(set(own)) == 4
    assert DRAWN[0] == DRAWN[-1]
