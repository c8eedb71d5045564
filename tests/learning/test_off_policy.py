"""Settings and learning that off-policy methods share."""

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.off_policy import OffPolicySettings
from softgym_mj.learning.registry import find_method

RISES = {"discount": 0.95, "final_discount": 0.9875, "discount_schedule": (100, 300)}


def test_the_horizon_grows_by_equal_factors():
    settings = OffPolicySettings(**RISES)
    for env_steps, horizon in ((0, 20.0), (100, 20.0), (200, 40.0), (300, 80.0), (900, 80.0)):
        assert 1.0 / (1.0 - settings.discount_at(env_steps)) == pytest.approx(horizon)
    assert OffPolicySettings(discount=0.9).discount_at(10**6) == 0.9


def test_batches_are_of_the_discount_of_their_time():
    settings = RISES | {"discount_schedule": (4, 8)}
    method = find_method("sac", hidden=(8,), random_steps=0, updates=2, replay=32, **settings)
    problem = Problem("straighten_rope", {}, [0], 2, (3,), 2, 1.0, "cpu")
    learner, no = method.make(method.settings, problem), torch.zeros(1, 2, dtype=torch.bool)
    result = []
    for _ in range(5):
        seen, reward = torch.randn(1, 2, 3), torch.zeros(1, 2)
        learner.learn(Step(seen, torch.zeros(1, 2, 2), reward, seen, no, no))
        result.append(learner.replay.sample(1).discount.item())
    assert result == pytest.approx([0.95, 0.95, 1.0 - 0.05 / 2.0, 0.9875, 0.9875])


def test_bad_settings_are_refused():
    for name, value in (
        ("discount", 0.0),
        ("discount", 1.5),
        ("final_discount", 0.9),
        ("final_discount", 1.0),
        ("discount_schedule", (3, 3)),
    ):
        with pytest.raises(InvalidArgumentError, match=name):
            OffPolicySettings(**{"discount": 0.95, name: value})


def test_updates_are_a_multiple_of_the_intervals_of_actor_and_targets():
    method = find_method("sac", hidden=(8,), updates=3, actor_every=2, target_every=3)
    problem = Problem("straighten_rope", {}, [0], 2, (3,), 2, 1.0, "cpu")
    with pytest.raises(
        InvalidArgumentError, match=r"updates=3 .* 6 \(actor_every=2, target_every=3\)"
    ):
        method.make(method.settings, problem)
