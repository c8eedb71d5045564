"""Policies averaged over a task's symmetries."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.off_policy import OffPolicySettings
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.signed_orders import SymmetrizedPolicy
from softgym_mj.learning.symmetries import symmetries


@pytest.fixture(name="own", params=["straighten_rope", "fold_cloth", "drop_cloth"], scope="module")
def _own(request):
    env = softgym_mj.load(request.param, split="all", fidelity="fast", observation="markov")
    env.reset(3)
    return symmetries(env, "markov")


def _policy(own):
    torch.manual_seed(0)
    sizes = len(own[0].observation), len(own[0].action)
    return torch.nn.Sequential(torch.nn.Linear(*sizes), torch.nn.Tanh()).double().eval(), sizes[0]


def _averaged(own, policy):
    result = SymmetrizedPolicy(policy, own, "cpu").double()
    return lambda seen: result(torch.as_tensor(seen)).detach().numpy()


def test_it_is_the_mean_over_forms_that_leave_pickers_theirs(own):
    policy, size = _policy(own)
    seen = np.random.default_rng(1).normal(size=(5, size))
    actions = [
        policy(torch.as_tensor(seen @ s.observation.T)).detach().numpy() @ np.linalg.inv(s.action).T
        for s in own
        if s.pickers == (0, 1)
    ]
    assert len(actions) == len(own) // 2
    np.testing.assert_allclose(_averaged(own, policy)(seen), np.mean(actions, 0), atol=1e-7)


def test_it_does_the_same_in_each_form(own):
    policy, size = _policy(own)
    averaged, seen = _averaged(own, policy), np.random.default_rng(2).normal(size=(5, size))
    for s in (s for s in own if s.pickers == (0, 1)):
        there = averaged(seen @ s.observation.T)
        np.testing.assert_allclose(there, averaged(seen) @ s.action.T, atol=1e-7)
    alone = policy(torch.as_tensor(seen)).detach().numpy()
    turned = policy(torch.as_tensor(seen @ own[-1].observation.T)).detach().numpy()
    assert np.abs(turned - alone @ own[-1].action.T).max() > 0.1  # Which it did not without.


def test_a_policy_that_is_kept_does_what_is_evaluated():
    settings = {"hidden": (16, 16), "random_steps": 0, "replay": 8, "symmetric": True}
    method = find_method("sac", symmetrize_policy=True, **settings)
    problem = Problem("fold_cloth", {"fidelity": "fast"}, [4, 9], 2, (26,), 8, 1.0, "cpu", "markov")
    learner = method.make(method.settings, problem)
    seen = torch.randn(2, 3, 26)
    first = torch.zeros(2, 3, dtype=torch.bool)
    best, _ = learner.act(seen, first, None, explore=False)
    for k in range(2):
        torch.testing.assert_close(learner.policy(k)(seen[k]), best[k])
    plain = find_method("sac", **settings)
    other, _ = plain.make(plain.settings, problem).act(seen, first, None, explore=False)
    assert (best - other).abs().max() > 0.1


def test_what_has_no_forms_is_not_averaged():
    with pytest.raises(InvalidArgumentError, match="symmetrize_policy"):
        OffPolicySettings(symmetrize_policy=True)
    method = find_method("sac", symmetric=True, symmetrize_policy=True, hidden=(8,))
    problem = Problem("rope_configuration", {}, [0], 2, (36,), 8, 1.0, "cpu", "full")
    with pytest.raises(InvalidArgumentError, match="observation"):
        method.make(method.settings, problem)
