"""Distillation: its oracles are plain loops, the teacher itself, one seed alone."""

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box

import softgym_mj
from softgym_mj.cli import training
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.frames import pictured
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.action_forms import Bins, Values
from softgym_mj.learning.methods.distill import LABEL, Distill, DistillSettings
from softgym_mj.learning.methods.students import Student
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.policies.exported import export_policy
from softgym_mj.policies.reactive import rope_configuration

SIZE = 35
SHAPES = {"markov": (1,), "rgb": (SIZE, SIZE, 3), "held": (2,)}
SMALL = {"channels": 4, "features": 6, "hidden": (8,), "shift": 0, "buffer": 3_200}


def problem(num_envs=16, env_steps=16_000):
    return Problem(
        "straighten_rope", {}, (0,), num_envs, (), 1, 1.0, "cpu", ("rgb", "held"), SHAPES,
        env_steps,
    )  # fmt: skip


def _observing(observed, shapes, task):
    """A problem of four environments with other observations."""
    return Problem(task, {}, [0], 4, (), 8, 1.0, "cpu", observed, shapes, 100)


def _teacher(seen):
    """To the middle, from places in -1..1."""
    return -0.8 * seen["markov"]


def seen_at(places):
    """A bar in each image at places (seeds, num_envs, 1) in -1..1."""
    across = torch.linspace(-1.0, 1.0, SIZE) - places
    row = (255.0 * torch.exp(-((across / 0.15) ** 2))).to(torch.uint8)
    shape = (*places.shape[:2], SIZE, SIZE, 3)
    return {
        "markov": places, "held": torch.zeros(*places.shape[:2], 2),
        "rgb": row[:, :, None, :, None].expand(shape),
    }  # fmt: skip


def _step(learner, places, first):
    """Lets a learner see places and learn; returns its actions."""
    action, _ = learner.act(seen_at(places), first, None, explore=True)
    none = torch.zeros(first.shape)
    learner.learn(Step(places, action, none, places, none, none))
    return action


def test_the_loss_is_the_smooth_l1_distance_computed_by_hand():
    labels, actions = torch.tensor([[0.1], [-0.9], [0.5]]), torch.tensor([[0.3], [0.6], [0.5]])
    # |.2| and 0 are below beta: x^2 / (2 beta); |1.5| is above it: x - beta / 2.
    expected = (0.2**2 / (2 * 0.5) + (1.5 - 0.5 / 2) + 0.0) / 3
    form = Values(beta=0.5)
    assert form.loss(actions.atanh(), labels).item() == pytest.approx(expected, rel=1e-6)
    torch.testing.assert_close(form.chosen(actions.atanh()), actions)


def test_the_loss_of_bins_is_the_cross_entropy_computed_by_hand():
    labels = torch.tensor([[-0.75], [1.0]])
    scores = torch.tensor([[2.0, 1.0, 0.0], [0.0, 0.0, 3.0]])
    # -0.75 is three quarters of -1 and a quarter of 0; 1 is the last value.
    logs = [
        2.0 - np.log(np.exp([2.0, 1.0, 0.0]).sum()), 1.0 - np.log(np.exp([2.0, 1.0, 0.0]).sum()),
        3.0 - np.log(np.exp([0.0, 0.0, 3.0]).sum()),
    ]  # fmt: skip
    expected = -(0.75 * logs[0] + 0.25 * logs[1] + logs[2]) / 2
    assert Bins(3).loss(scores, labels).item() == pytest.approx(expected, rel=1e-6)


def test_a_learner_has_the_loss_of_its_settings_form():
    batch = {name: array[0] for name, array in seen_at(torch.tensor([[[0.2], [-0.4]]])).items()}
    batch["rgb"] = torch.stack([batch["rgb"], batch["rgb"]], 1)  # Two images of each.
    batch[LABEL] = torch.tensor([[0.1], [-0.9]])
    for settings, form in (({"beta": 0.5}, Values(0.5)), ({"bins": 3}, Bins(3))):
        learner = Distill(DistillSettings(**SMALL, **settings), problem(), _teacher)
        student = learner.students[0]
        expected = form.loss(student.outputs(batch), batch[LABEL])
        torch.testing.assert_close(learner.loss(student, batch), expected)
        torch.testing.assert_close(student(batch), form.chosen(student.outputs(batch)))


def test_chosen_actions_are_means_in_the_window_that_holds_the_most():
    values = [-1.0, -0.5, 0.0, 0.5, 1.0]
    cases = [
        ([0.35, 0.0, 0.05, 0.3, 0.3], 3),  # -1 is the single best, but 0.5 and 1 are neighbors.
        ([0.55, 0.1, 0.0, 0.2, 0.15], 0),
    ]
    for shares, best in cases:
        inside = [
            [share * np.exp(-0.5 * ((value - center) / 0.5) ** 2)
             for share, value in zip(shares, values, strict=True)]
            for center in values
        ]  # fmt: skip
        assert np.argmax(np.sum(inside, 1)) == best
        expected = np.dot(inside[best], values) / np.sum(inside[best])
        found = Bins(5).chosen(torch.tensor(shares).log()[None])
        assert found.item() == pytest.approx(expected, rel=1e-5)


def _signed(seen):
    return 0.6 * seen["markov"].sign()


@pytest.mark.long
@pytest.mark.parametrize("bins", [0, 21])
def test_students_with_bins_choose_one_of_two_labels_where_others_average(bins):
    """Labels have a sign that a student does not observe, 0.6 in two thirds and -0.6 in a third."""
    settings = DistillSettings(
        **SMALL, bins=bins, rate=3e-3, updates=8, batch=64, noise=0.0, wild_noise=0.0
    )
    learner = Distill(settings, problem(num_envs=48, env_steps=48 * 40), _signed)
    signs = torch.where(torch.arange(48) % 3 > 0, 1.0, -1.0)[None, :, None]
    hidden = seen_at(torch.zeros(1, 48, 1))
    first = torch.ones(1, 48, dtype=bool)
    for _ in range(40):
        learner.act({**hidden, "markov": signs}, first, None, explore=True)
        learner.learn(Step(*[None] * 6))
    action, _ = learner.act({**hidden, "markov": signs}, first, None, explore=False)
    if bins:
        # The window around 0.6 holds exp(-(1.2 / 0.5)^2 / 2) = 0.056 of the labels of -0.6.
        expected = 0.6 * (2 - 0.056) / (2 + 0.056)
        assert action.flatten().tolist() == pytest.approx([expected] * 48, abs=0.03)
    else:
        assert 0.0 < action.mean().item() < 0.55


def test_steps_are_shown_by_symmetries_with_their_labels():
    observed, size = ("key_points", "markov", "held"), {"key_points": 198, "markov": 26, "held": 2}
    shapes = {name: (number,) for name, number in size.items()}
    learner = Distill(
        DistillSettings(**{**SMALL, "batch": 200}, symmetric=True),
        Problem("drop_cloth", {}, (0,), 1, (), 8, 1.0, "cpu", observed, shapes, 100),
        lambda seen: seen["markov"][..., :8],
    )
    source = np.random.default_rng(0)
    seen = {name: source.normal(size=number) for name, number in size.items()}
    tensors = {name: torch.tensor(each[None, None]).float() for name, each in seen.items()}
    learner.act(tensors, torch.ones(1, 1, dtype=bool), None, explore=True)
    env = softgym_mj.load("drop_cloth", split="all")
    env.reset(0)
    expected = []
    for each in zip(*(symmetries(env, name) for name in observed), strict=True):
        turned = [own.observation @ seen[name] for own, name in zip(each, observed, strict=True)]
        expected.append(np.concatenate([*turned, each[0].action @ seen["markov"][:8]]))
    batch = learner._sampled(0)
    found = np.concatenate([batch[name].numpy() for name in (*observed, LABEL)], 1)
    found = np.unique(found.round(4), axis=0)
    np.testing.assert_allclose(found, np.unique(np.round(expected, 4), axis=0), atol=2e-4)


def test_symmetric_students_of_images_are_refused():
    with pytest.raises(InvalidArgumentError, match=r"observation=.*'rgb'.* with symmetric=True"):
        Distill(DistillSettings(**SMALL, symmetric=True), problem(), _teacher)


def test_the_network_is_that_of_its_layers():
    torch.manual_seed(0)
    shapes = {"rgb": (36, 38, 3), "external_rgb": (2, 36, 38, 3), "depth": (36, 38), "held": (2,)}
    student = Student(DistillSettings(**SMALL), shapes, 3)
    seen = {
        "rgb": torch.randint(0, 256, (2, 2, 36, 38, 3), dtype=torch.uint8),
        "external_rgb": torch.randint(0, 256, (2, 2, 2, 36, 38, 3), dtype=torch.uint8),
        "depth": torch.rand(2, 2, 36, 38),
        "held": torch.tensor([[0, 1], [1, 0]], dtype=torch.uint8),
    }
    channels = [seen["rgb"][:, k, :, :, c] / 255 for k in range(2) for c in range(3)]
    channels += [
        seen["external_rgb"][:, k, camera, :, :, c] / 255
        for k in range(2) for camera in range(2) for c in range(3)
    ]  # fmt: skip
    channels += [seen["depth"][:, k] for k in range(2)]
    x = torch.stack(channels, 1)
    for layer in student.encoder[:8:2]:
        x = torch.relu(torch.nn.functional.conv2d(x, layer.weight, layer.bias, layer.stride))
    x = x.flatten(1) @ student.encoder[9].weight.T + student.encoder[9].bias
    x = torch.tanh(
        (x - x.mean(1, keepdim=True)) / (x.var(1, keepdim=True, correction=0) + 1e-5) ** 0.5
    )
    x = torch.cat([x, seen["held"].float()], 1)
    x = torch.relu(x @ student.head[0].weight.T + student.head[0].bias)
    expected = torch.tanh(x @ student.head[2].weight.T + student.head[2].bias)
    torch.testing.assert_close(student(seen), expected, rtol=1e-4, atol=1e-5)


def test_cameras_become_channels():
    views = torch.arange(2 * 4 * 5 * 3).reshape(1, 2, 4, 5, 3)
    expected = np.concatenate([views[0, 0], views[0, 1]], axis=-1)
    np.testing.assert_array_equal(pictured(views, 1)[0], expected)
    assert pictured(torch.zeros(7, 4, 5), 1).shape == (7, 4, 5, 1)


# 12 environments, then 12 (1 - k / 4), none after half of the eight steps.
@pytest.mark.parametrize(("until", "driven"), [(0.5, [12, 9, 6, 3, 0, 0]), (None, [12] * 6)])
def test_the_teacher_acts_in_fewer_and_fewer_environments(until, driven):
    settings = DistillSettings(
        **SMALL,
        updates=1,
        batch=4,
        noise=0.0,
        wild_noise=0.0,
        teacher_share=0.75,
        teacher_until=until,
    )
    learner = Distill(settings, problem(env_steps=16 * 8), _teacher)
    places, first = torch.linspace(-1.0, 1.0, 16)[None, :, None], torch.ones(1, 16, dtype=bool)
    result = []
    for _ in range(6):
        action = _step(learner, places, first)
        result.append((action - _teacher({"markov": places})).abs().flatten() < 1e-6)
        first = torch.zeros(1, 16, dtype=bool)
    assert [int(each.sum()) for each in result] == driven
    assert result[0][:12].all()


def test_the_rate_rises_then_falls():
    settings = DistillSettings(**SMALL, updates=1, batch=4, rate=1.0, warm_up=4)
    learner = Distill(settings, problem(env_steps=16 * 10), _teacher)
    rates = []
    for _ in range(10):
        _step(learner, torch.zeros(1, 16, 1), torch.ones(1, 16, dtype=bool))
        rates.append(learner._rate.item())
    # min(k / 4, 1) * (1 - k / 10) of the largest, k = 1..10.
    assert rates == pytest.approx([0.225, 0.4, 0.525, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0], abs=1e-6)


def test_gradients_are_scaled_to_the_largest_norm():
    first = torch.ones(1, 16, dtype=bool)
    settings = DistillSettings(**SMALL, updates=1, batch=4, gradient_norm=1e-3)
    learner = Distill(settings, problem(), lambda seen: 0.0 * seen["markov"] + 1.0)
    _step(learner, torch.zeros(1, 16, 1), first)
    squares = [p.grad.square().sum() for p in learner.students[0].parameters()]
    assert torch.stack(squares).sum().sqrt().item() == pytest.approx(1e-3, rel=1e-3)


def test_noise_is_larger_in_an_eighth():
    settings = DistillSettings(**SMALL, updates=1, batch=4, noise=0.05, wild_noise=0.2)
    learner = Distill(
        settings, problem(num_envs=1_600, env_steps=1_600), lambda seen: 0.0 * seen["markov"]
    )
    learner._steps = 10**6  # The teacher never acts.
    places, first = torch.zeros(1, 1_600, 1), torch.ones(1, 1_600, dtype=bool)
    best, _ = learner.act(seen_at(places), first, None, explore=False)
    action, _ = learner.act(seen_at(places), first, None, explore=True)
    noise = (action - best)[0, :, 0]
    assert noise[:1_400].std().item() == pytest.approx(0.05, rel=0.06)
    assert noise[1_400:].std().item() == pytest.approx(0.25, rel=0.15)


@pytest.fixture(name="teacher", scope="module")
def _saved_teacher(tmp_path_factory):
    """A file with a policy of `markov` observations of a rope."""
    file = tmp_path_factory.mktemp("teacher") / "teacher.pt2"
    module = torch.nn.Sequential(torch.nn.Linear(44, 8), torch.nn.Tanh())
    torch.export.save(torch.export.export(module, (torch.zeros(1, 44),)), file)
    return module, file


def test_a_saved_teacher_labels_batches(teacher):
    module, file = teacher
    result = find_method("distill", teacher=str(file), **SMALL)
    shapes = {"markov": (44,), "rgb": (SIZE, SIZE, 3)}
    learner = result.make(result.settings, _observing("rgb", shapes, "straighten_rope"))
    states = torch.randn(9, 44)
    torch.testing.assert_close(
        learner._teacher({"markov": states[None]})[0], module(states), rtol=1e-5, atol=1e-6
    )


class _Two(torch.nn.Module):
    """A policy of two observations, by name."""

    def forward(self, seen):
        return torch.cat([0.5 * seen["held"], seen["markov"][:, :6].tanh()], -1)


def test_a_saved_teacher_of_several_observations_labels_batches(tmp_path):
    file, names = tmp_path / "teacher.pt2", ("markov", "held")
    shapes = {"markov": (44,), "held": (2,), "rgb": (SIZE, SIZE, 3)}
    spaces = {"markov": Box(-1.0, 1.0, (44,)), "held": Box(0, 1, (2,), np.uint8)}
    file.write_bytes(export_policy(_Two(), spaces, {"observation": [*names], "actor": "franka"}))
    settings = training._teacher(str(file), True)
    assert settings == {"teacher": str(file), "privileged": "markov+held", "actor": "franka"}
    result = find_method("distill", teacher=str(file), privileged="markov+held", **SMALL)
    learner = result.make(result.settings, _observing("rgb", shapes, "straighten_rope"))
    states, held = torch.randn(2, 9, 44), torch.randint(0, 2, (2, 9, 2), dtype=torch.uint8)
    expected = torch.cat([0.5 * held, states[..., :6].tanh()], -1)
    torch.testing.assert_close(learner._teacher({"markov": states, "held": held}), expected)


def test_a_policy_acts_as_its_student_with_half_the_bytes():
    learner = Distill(DistillSettings(), problem(), _teacher)
    seen = {
        "rgb": torch.randint(0, 256, (3, 2, SIZE, SIZE, 3), dtype=torch.uint8),
        "held": torch.rand(3, 2),
    }
    expected, policy = learner.students[0](seen), learner.policy(0)
    # float16 has 11 bits.
    torch.testing.assert_close(policy(seen), expected, rtol=0, atol=2e-3)
    sizes = [
        sum(p.numel() * p.element_size() for p in network.parameters())
        for network in (policy, learner.students[0])
    ]
    assert sizes[0] == sizes[1] / 2


def _of_ropes(shapes):
    """A problem of ropes with these observations and the teacher's."""
    return _observing(tuple(shapes), {**shapes, "markov": (74,)}, "rope_configuration")


def test_a_function_of_a_module_labels_states_for_students_of_states():
    name = "softgym_mj.policies.reactive:rope_configuration"
    assert training._teacher(name, False) == {"teacher": name, "privileged": "markov"}
    result = find_method("distill", teacher=name, **SMALL)
    problem = _of_ropes({"reduced": (66,), "held": (2,)})
    learner = result.make(result.settings, problem)
    states = 0.1 * torch.randn(1, 4, 74)
    torch.testing.assert_close(learner._teacher({"markov": states}), rope_configuration(states))
    # Linear, norm, tanh, then the head on the features and all numbers.
    student, seen = learner.students[0], {"reduced": states[0, :, :66], "held": torch.ones(4, 2)}
    numbers = torch.cat([seen["reduced"], seen["held"]], -1)
    linear, norm, _ = student.encoder
    features = norm(numbers @ linear.weight.T + linear.bias).tanh()
    expected = student.head(torch.cat([features, numbers], -1)).tanh()
    torch.testing.assert_close(student(seen), expected)


def test_a_teacher_takes_the_observations_that_its_function_names(monkeypatch):
    name = "softgym_mj.policies.reactive:fold_crumpled_cloth"
    settings = training._teacher(name, False)
    assert settings == {"teacher": name, "privileged": "full+markov"}
    seen = {
        "full": torch.rand(1, 4, 30),
        "markov": torch.rand(1, 4, 26),
        "held": torch.ones(1, 4, 2),
    }
    shapes = {each: tuple(array.shape[2:]) for each, array in seen.items()}
    problem = _observing(("full", "held"), shapes, "fold_crumpled_cloth")
    taken = []

    def teacher(states):
        taken.append(states)
        return torch.zeros(1, 4, 8)

    monkeypatch.setattr("softgym_mj.policies.reactive.fold_crumpled_cloth", teacher)
    result = find_method("distill", **settings, **SMALL)
    learner = result.make(result.settings, problem)
    learner.act(seen, torch.ones(1, 4, dtype=torch.bool), None, explore=True)
    torch.testing.assert_close(taken[0], torch.cat([seen["full"], seen["markov"]], -1))
    # The student observes its own part.
    assert learner.students[0].others == ["full", "held"]


def test_students_of_points_need_numbers_with_the_reduced_state():
    settings = DistillSettings(**SMALL | {"features": 8}, points=True)
    for shapes in ({"reduced": (66,), "rgb": (SIZE, SIZE, 3)}, {"full": (246,), "held": (2,)}):
        with pytest.raises(InvalidArgumentError, match="points=True"):
            Distill(settings, _of_ropes(shapes), _teacher)
    learner = Distill(settings, _of_ropes({"held": (2,), "reduced": (66,)}), _teacher)
    seen = {"held": torch.zeros(3, 2), "reduced": torch.rand(3, 66)}
    numbers = torch.cat([seen["reduced"], seen["held"]], -1)
    student = learner.students[0]
    expected = student.head(torch.cat([student.encoder(numbers), numbers], -1)).tanh()
    torch.testing.assert_close(student(seen), expected)


def test_students_of_points_take_those_of_the_first_observation():
    settings = DistillSettings(**SMALL | {"features": 8}, points=True)
    shapes = {"markov": (26,), "key_points": (198,)}
    for observed, number in ((("markov", "key_points"), 4), (("key_points", "markov"), 64)):
        problem = _observing(observed, shapes, "fold_crumpled_cloth")
        student = Distill(settings, problem, _teacher).students[0]
        assert student.others == [*observed] and student.encoder.points.shape == (number, 3)


def test_teachers_of_another_task_are_refused(teacher):
    """A file of a rope's policy, functions that raise or return no actions; 66 numbers a state."""
    states = torch.zeros(1, 4, 66)
    shapes = "for observations {'markov': (1, 4, 66)}"
    for name, words in {
        str(teacher[1]): f"failed: expected actions (1, 4, 8) {shapes}",
        "softgym_mj.policies.reactive:drop_cloth": "cannot be imported",
        "torch:logdet": f"failed: expected actions (1, 4, 8) {shapes}",
        "torch:zeros_like": "returns (1, 4, 66): expected actions (1, 4, 8)",
        "torch:is_tensor": "returns bool: expected actions (1, 4, 8)",
    }.items():
        with pytest.raises(InvalidArgumentError) as error:
            result = find_method("distill", teacher=name, **SMALL)
            problem = _of_ropes({"reduced": (66,), "held": (2,)})
            result.make(result.settings, problem)._teacher({"markov": states})
        assert f"teacher={name!r} {words}" in str(error.value)


def test_missing_functions_are_refused_as_teachers():
    with pytest.raises(InvalidArgumentError, match=r"teacher=.* cannot be imported"):
        training._teacher("softgym_mj.policies.reactive:missing", False)


def test_bad_settings_are_refused():
    with pytest.raises(InvalidArgumentError, match="35 pixels"):
        Student(DistillSettings(), {"rgb": (20, 20, 3)}, 2)
    for bins in (-1, 1, 2):
        with pytest.raises(InvalidArgumentError, match=f"bins={bins}"):
            DistillSettings(bins=bins)


@pytest.mark.parametrize("observed", ["rgb", "depth", "external_rgb", ["reduced", "rgb"]])
def test_teachers_of_images_are_refused(tmp_path, monkeypatch, observed):
    file = tmp_path / "teacher.pt2"
    file.touch()
    monkeypatch.setattr(
        "softgym_mj.policies.exported.observes", lambda name: {"observation": observed}
    )
    with pytest.raises(InvalidArgumentError, match="a state policy"):
        training._teacher(str(file), True)
