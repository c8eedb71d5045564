"""Settings side by side: each seed learns with its own what it would learn alone."""

import pytest
import torch

from benchmarks.screening import screen, varied
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.registry import find_method

OBSERVATION, ACTION, WORLDS = 4, 2, 3
VARY = {
    "discount": [0.9, 0.99],
    "added": [1, 3],
    "target_entropy": [0.25, -1.0],
    "pessimism": [0.0, 1.0],
}


def _learner(seeds, **settings):
    method = find_method(
        "sac", hidden=(8,), random_steps=0, updates=2, batch=16, replay=60, **settings
    )
    own = Problem("straighten_rope", {}, seeds, WORLDS, (OBSERVATION,), ACTION, 1.0, "cpu")
    return method.make(method.settings, own)


def _steps(seeds):
    source = torch.Generator().manual_seed(0)
    for t in range(12):
        seen, later = (torch.randn(2, WORLDS, OBSERVATION, generator=source) for _ in range(2))
        action = torch.rand(2, WORLDS, ACTION, generator=source)
        reward = torch.randn(2, WORLDS, generator=source)
        no, ends = (torch.full((2, WORLDS), said) for said in (False, t == 5))
        yield Step(*(array[seeds] for array in (seen, action, reward, later, no, ends)))


def test_each_seed_learns_what_it_would_learn_alone():
    together = varied(_learner([4, 9], added=3), VARY)
    for step in _steps([0, 1]):
        together.learn(step)
    for k, seed in enumerate((4, 9)):
        alone = _learner(
            [seed], **{name: values[k] for name, values in VARY.items()} | {"added": 3}
        )
        # Not as a setting: it would learn before the other one does, and draw other steps.
        alone.replay.added.fill_(VARY["added"][k])
        for step in _steps([k]):
            alone.learn(step)
        for own, other in zip(
            alone.algorithm.critics.parameters(), together.algorithm.critics.parameters(),
            strict=True,
        ):  # fmt: skip
            torch.testing.assert_close(other[2 * k : 2 * k + 2], own, rtol=1e-4, atol=1e-6)
        torch.testing.assert_close(together.algorithm.alpha[k], alone.algorithm.alpha[0])


def test_a_task_is_screened(tmp_path):
    settings = {
        "observation": "markov", "env_steps": 24, "part": 12, "worlds": 2, "episodes": 1,
        "final_episodes": 1, "fidelity": "fast", "hidden": [8], "random_steps": 4, "updates": 2,
        "batch": 4, "replay": 16, "episode_steps": 6,
    }  # fmt: skip
    vary = {"discount": [0.9, 0.99], "added": [1, 3]}
    scores = screen("straighten_rope", "fast", settings, vary, tmp_path, "host")
    assert len(scores) == 2 and all(-3.0 < score <= 1.0 for score in scores)
    with pytest.raises(StoreError, match="another folder"):  # Of which numbers is not known.
        screen("straighten_rope", "fast", settings, {"discount": [0.8, 0.9]}, tmp_path, "host")


def test_a_discount_that_varies_does_not_rise(tmp_path):
    with pytest.raises(InvalidArgumentError, match="last_discount"):
        settings = {"last_discount": 0.99}
        screen("straighten_rope", "fast", settings, {"discount": [0.9]}, tmp_path, "host")


@pytest.mark.parametrize(
    ("vary", "named"),
    [({"tau": [0.1]}, "vary"), ({"discount": [0.9], "added": []}, "vary"),
     ({"discount": [0.9, 1.5]}, "discount")],
)  # fmt: skip
def test_what_cannot_vary_is_refused(vary, named, tmp_path):
    with pytest.raises(InvalidArgumentError, match=named):
        screen("straighten_rope", "fast", {}, vary, tmp_path, "host")
