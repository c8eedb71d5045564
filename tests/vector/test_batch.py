"""Rows of arrays in place of environments: their oracle is `SoftGymEnv`, bit by bit."""

import functools
from typing import Unpack

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

import softgym_mj
import softgym_mj.tasks.straighten_rope
import softgym_mj.vector.batch.initial_states
from softgym_mj.batch.device import CpuDevice
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, SnapshotError
from softgym_mj.metrics import Measures, constant
from softgym_mj.robots.grip import GripCommand
from softgym_mj.robots.gripper import DISPLACEMENTS, MAX_DISPLACEMENT, gripper_actions
from softgym_mj.robots.picker import ROPE_GEOMETRY, Picker
from softgym_mj.tasks import TaskSettings
from softgym_mj.tasks.shared.entries import numbers
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.batch.padded_rows import PaddedRows, leaves
from tests.kinds import by_kind, by_material
from tests.native.torch_device import TorchDevice
from tests.vector.same import same

STATES = ["full", "full_mask", "held", "key_points", "markov", "proprioception", "reduced"]
VARIATIONS = [803, 806, 811]


def _settings(task, settings):
    water = "water" in softgym_mj.TASKS[task].tags
    names = [name for name in STATES if not (water and name == "held")]
    return {"observation": names, "fidelity": "fast", "split": "all", **settings}


def _make(task, number=3, **settings):
    settings = _settings(task, settings)
    return softgym_mj.make_vec(task, number, device="host", **settings)


def _env(task, **settings):
    return SoftGymEnv(task, **_settings(task, settings))


def _actions(envs, number):
    """Random ones with the grips mostly on."""
    shape = (number, *envs.action_space.shape)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    if actions.shape[-1] % 4 == 0:
        actions[..., 3::4] += 0.7
    return actions.clip(-1.0, 1.0)


def _check(i, batch, alone):
    """Checks that row `i` of a batch's result equals the result of an environment."""
    observations, infos = batch
    observation, info = alone
    for name, array in observation.items():
        np.testing.assert_array_equal(observations[name][i], array, err_msg=name)
        assert observations[name].dtype == array.dtype
    assert {name for name in infos if not name.startswith("_")} == set(info)
    for name, value in info.items():
        assert infos[f"_{name}"][i]
        # Sums over rows of an array differ in the last bit.
        assert infos[name][i] == pytest.approx(value, rel=1e-12, abs=1e-13), name


PIXELS = {"actor": "pixel_pick_and_place"}


@pytest.mark.parametrize(
    "task, settings",
    [
        *by_kind({}),
        ("fold_cloth", PIXELS),
        pytest.param("spread_cloth", PIXELS, marks=pytest.mark.long),
    ],
)
def test_a_row_is_an_environment(task, settings):
    _check_rows(task, settings, 3 if settings else 6)  # An action of pixels is many sim steps.


def _check_rows(task, settings, steps):
    envs, alone = _make(task, **settings), [_env(task, **settings) for _ in VARIATIONS]
    batch = envs.reset(seed=0, options={"variation": VARIATIONS})
    for i, (env, variation) in enumerate(zip(alone, VARIATIONS, strict=True)):
        _check(i, batch, env.reset(options={"variation": variation}))
    for actions in _actions(envs, steps):
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        for i, env in enumerate(alone):
            observation, reward, *ended, info = env.step(actions[i])
            _check(i, (observations, infos), (observation, info))
            assert rewards[i] == pytest.approx(reward, rel=1e-12, abs=1e-13)
            assert [terminated[i], truncated[i]] == ended
    envs.close()
    return infos


def test_domain_parameters_differ_from_row_to_row():
    infos = _check_rows("fold_cloth", {"domain": {"physics": "in_distribution"}}, 3)
    assert len(set(infos["domain_friction"])) == 3


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_it_plays_what_worker_processes_play(mode):
    settings = {"observation": "reduced", "fidelity": "fast", "horizon": 3, "autoreset_mode": mode}
    here = softgym_mj.make_vec("straighten_rope", 3, device="host", **settings)
    there = softgym_mj.make_vec("straighten_rope", 3, num_workers=1, **settings)
    options = {"stagger": True}
    first, second = (envs.reset(seed=5, options=options) for envs in (here, there))
    np.testing.assert_array_equal(first[0], second[0])
    for actions in _actions(here, 8):
        mine, theirs = here.step(actions), there.step(actions)
        for ours, others in zip(mine[:4], theirs[:4], strict=True):
            np.testing.assert_allclose(ours, others, rtol=1e-12)
        np.testing.assert_array_equal(mine[4]["variation"], theirs[4]["variation"])
        assert mine[4].keys() == theirs[4].keys()
    here.close()
    there.close()


def test_who_resets_who_is_told_to():
    envs = _make("straighten_rope", autoreset_mode="Disabled", horizon=2)
    envs.reset(seed=0)
    actions = _actions(envs, 3)
    envs.step(actions[0])
    before, *_, truncated, _ = envs.step(actions[1])
    assert truncated.all()
    with pytest.raises(LifecycleError, match="have ended"):
        envs.step(actions[2])
    mask = np.array([False, True, False])
    after, _ = envs.reset(seed=0, options={"reset_mask": mask, "variation": 806})
    same = (before["reduced"] == after["reduced"]).all(1)
    assert same.tolist() == [True, False, True]
    envs.close()


@pytest.mark.parametrize(
    "task, settings",
    [
        ("drop_cloth", {}),
        ("rope_configuration", {}),
        ("pour_water", {}),
        ("straighten_rope", PIXELS),
    ],
)
def test_snapshots_go_to_environments_and_back(task, settings):
    envs = _make(task, **settings)
    envs.reset(seed=0, options={"variation": VARIATIONS})
    actions = _actions(envs, 5)
    for each in actions[:2]:
        envs.step(each)
    states = envs.get_state()
    later = [envs.step(each) for each in actions[2:]]
    # In other rows, of another number of them.
    more = _make(task, 4, **settings)
    more.reset(seed=0)
    more.set_state([states[2], states[1], states[0], states[1]])
    rows = [2, 1, 0, 1]
    for each, (observations, rewards, *_) in zip(actions[2:], later, strict=True):
        others, their_rewards = more.step(each[rows])[:2]
        for name, array in observations.items():
            np.testing.assert_array_equal(others[name], array[rows])
        np.testing.assert_allclose(their_rewards, rewards[rows], rtol=1e-13)
    # In an environment, and from there into a row.
    env = _env(task, **settings)
    env.set_state(states[1])
    env.step(actions[2][1])
    middle = env.get_state()
    for each, (observations, *_) in zip(actions[3:], later[1:], strict=True):
        observation = env.step(each[1])[0]
        for name, array in observation.items():
            np.testing.assert_array_equal(observations[name][1], array)
    more.set_state([middle] * 4)
    for each, (observations, *_) in zip(actions[3:], later[1:], strict=True):
        others = more.step(np.tile(each[1], (4, 1)))[0]
        np.testing.assert_array_equal(others["full"], np.tile(observations["full"][1], (4, 1)))
    with pytest.raises(SnapshotError, match="is of task"):
        _make("fold_cloth", 1).set_state([middle])
    envs.close()
    more.close()


def test_a_row_that_diverges_ends_alone():
    envs = _make("straighten_rope", autoreset_mode="NextStep")
    twin = _make("straighten_rope", autoreset_mode="NextStep")
    for each in (envs, twin):
        each.reset(options={"variation": VARIATIONS})
    envs.backend._physics._solver.qvel[1, 5] = np.inf
    actions = _actions(envs, 3)
    for i, each in enumerate(actions):
        mine, theirs = envs.step(each), twin.step(each)
        for name, array in theirs[0].items():
            np.testing.assert_array_equal(mine[0][name][[0, 2]], array[[0, 2]])
        assert mine[2].tolist() == [False, i == 0, False]
        assert mine[4]["physics_warnings"].tolist() == [0, int(i == 0), 0]
        assert all(np.isfinite(array).all() for array in mine[0].values())
    envs.close()
    twin.close()


def test_what_it_cannot_do_is_refused_by_name():
    for task, settings, name in (
        ("straighten_rope", {"actor": "pick_and_place"}, "actor='pick_and_place'"),
        ("straighten_rope", {"observation": "point_cloud"}, "point_cloud' is.*device='cpu'"),
        ("straighten_rope", {"render_mode": "rgb_array"}, "render_mode='rgb_array'"),
        ("spread_cloth", {"count_intersections": True}, "count_intersections=True"),
        ("straighten_rope", {"context": "fork"}, "context='fork'"),
        ("straighten_rope", {"num_workers": 3}, "num_workers=3"),
    ):
        with pytest.raises(InvalidArgumentError, match=name):
            softgym_mj.make_vec(task, 2, device="host", **settings)
    envs = _make("straighten_rope", 2)
    with pytest.raises(InvalidArgumentError, match="name='render'"):
        envs.render()
    envs.close()


class _Counted(softgym_mj.tasks.straighten_rope.StraightenRope):
    """A custom task that reads one simulation."""

    def after_step(self, physics, random_state):
        super().after_step(physics, random_state)
        self.count = getattr(self, "count", 0) + 1


class _Looser(softgym_mj.tasks.straighten_rope.StraightenRope):
    """A custom task of functions of arrays."""

    success = 0.5


class _Ended(softgym_mj.tasks.straighten_rope.StraightenRope):
    """A custom task that ends early."""

    def should_terminate_episode(self, physics):
        return True


class _Windy(softgym_mj.entities.Rope):
    """A rope with a hook of its own."""

    def before_substep(self, physics, random_state):
        physics.data.qvel[:] += 0.5


class _Blown(softgym_mj.tasks.Task):
    """A custom task with such a rope."""

    summary, material, horizon = "Lift the rope.", "rope", 4

    def __init__(self, **settings: Unpack[softgym_mj.tasks.TaskSettings]):
        self.rope = _Windy()
        super().__init__([self.rope], **settings)

    def arrange(self, random):
        self.rope.set_points(self.rope.straight() + [0.0, 0.0, 0.01])

    def measure(self, state, episode):
        height = state.points["rope"][..., 2].mean(-1)
        return softgym_mj.tasks.Measures(height, {"height": height})


@pytest.mark.parametrize(
    ("task", "named"),
    [
        (_Ended, "class defines should_terminate_episode"),
        (_Blown, "_Windy defines before_substep"),
    ],
)
def test_hooks_of_a_single_simulation_are_refused(register, task, named):
    register("hooked_rope", task)
    with pytest.raises(InvalidArgumentError, match=f"{named}, is not available"):
        softgym_mj.make_vec("hooked_rope", 1, device="host")


def test_custom_tasks_are_played_if_they_are_functions_of_arrays(register):
    register("count_rope", _Counted)
    with pytest.raises(InvalidArgumentError, match="defines after_step, is not available"):
        softgym_mj.make_vec("count_rope", 1, device="host")
    register("loosen_rope", _Looser)
    envs = softgym_mj.make_vec("loosen_rope", 2, device="host", fidelity="fast")
    _, infos = envs.reset(seed=0, options={"variation": [1, 807]})
    assert (infos["success"] == (infos["normalized_performance"] >= 0.5)).all()
    envs.close()


def _first_height(points):
    return points["rope"][0, 2]  # Of vertex 0; in a batch, of vertex 2 of environment 0.


def _mean_x(points):
    return float(points["rope"][:, 0].mean())


def _end_distance(points):
    return np.linalg.norm(points["rope"][0] - points["rope"][-1])


@pytest.mark.parametrize(
    ("measured", "listed", "found"),
    [
        (_mean_x, None, r"'performance' by measure\(\) for 2 environments differs from.*0 alone"),
        (_end_distance, None, "'performance' .* differs from"),
        (_first_height, None, r"'performance' .* has shape \(3,\), expected \(2,\)"),
        (None, lambda of: numbers(of["rope"][:, 0]), r"'reduced' .* \(2, 9\), expected \(2, 47"),
        (None, lambda of: numbers(of["rope"][0]), "reduced fails .* ValueError"),
    ],
)
@pytest.mark.parametrize("variations", [[800, 801], [807, 3]])
def test_functions_of_single_arrays_are_refused(register, measured, listed, found, variations):
    class Single(softgym_mj.tasks.straighten_rope.StraightenRope):
        def measure(self, state, episode):
            if measured is None:
                return super().measure(state, episode)
            performance = measured(state.points)
            return Measures(performance, {"all": performance})

        def reduced(self, state, episode):
            own = super().reduced(state, episode)
            return own if listed is None else {"own": listed(state.points)}

    register("single_rope", Single)
    envs = softgym_mj.make_vec("single_rope", 2, device="host")
    with pytest.raises(InvalidArgumentError, match=f"{found}.*write `points"):
        envs.reset(options={"variation": variations})
    envs.close()


class _Planar(Picker):
    """Pickers that keep their height."""

    displaces = False

    @functools.cached_property
    def actions(self):
        return gripper_actions(self.num_grippers, DISPLACEMENTS[:2])

    def commands(self, actions):
        each = actions.reshape((*actions.shape[:-1], self.num_grippers, 3))
        moves = MAX_DISPLACEMENT * each * constant(np.array([1.0, 1.0, 0.0]), each)
        return GripCommand(moves, each[..., 2] > 0.0)


class _PlanarRope(softgym_mj.tasks.straighten_rope.StraightenRope):
    """A custom task whose pickers have an action space of their own."""

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[TaskSettings]):
        super().__init__(fidelity=fidelity, actor=_Planar(ROPE_GEOMETRY), **settings)


def test_pickers_have_action_spaces_of_their_own(register):
    register("planar_rope", _PlanarRope)
    _check_rows("planar_rope", {}, 6)


def test_rows_grow_with_what_is_put_into_them():
    rows = PaddedRows(1, CpuDevice())
    rows.put(0, {"a": np.ones((2, 1)), "b": {"c": 5}})
    rows.put(2, {"a": np.full((1, 3), 2.0), "b": {"c": 7}})
    assert rows.whole["b"]["c"].tolist() == [5, 0, 7, 0]
    found = [[[1, 0, 0], [1, 0, 0]], np.zeros((2, 3)), [[2, 2, 2], [0, 0, 0]]]
    np.testing.assert_array_equal(rows.whole["a"][:3], found)
    others = PaddedRows(2, CpuDevice())
    others.fit(rows)
    others.take(np.array([True, False]), rows, np.array([2, 0]))
    assert others.whole["b"]["c"].tolist() == [7, 0]
    np.testing.assert_array_equal(others.whole["a"], [found[2], np.zeros((2, 3))])
    rows.put(0, {"a": np.zeros((0, 0)), "b": {"c": 1}})
    assert not rows.whole["a"][0].any()


def test_gymnasium_makes_it():
    envs = gymnasium.make_vec("softgym_mj/StraightenRope-v0", 2, device="host", fidelity="fast")
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    assert envs.get_attr("horizon") == (75, 75)
    with pytest.raises(InvalidArgumentError, match=r"set_attr\('horizon', 5\) is not available"):
        envs.set_attr("horizon", 5)
    with pytest.raises(InvalidArgumentError, match="name='render' is not available"):
        envs.get_attr("render")
    with pytest.raises(AttributeError, match="has no attribute 'smell'"):  # As on the CPU.
        envs.get_attr("smell")
    envs.close()


def test_tensors_on_the_cpu_are_arrays_to_environments_in_arrays():
    arrays, tensors = (_make("straighten_rope", horizon=3) for _ in range(2))
    arrays.reset(seed=0)
    tensors.reset(seed=0)
    for actions in _actions(arrays, 3):
        assert same(arrays.step(actions), tensors.step(torch.from_numpy(actions)))
    with pytest.raises(InvalidArgumentError, match=r"actions\[1, 2\] = nan"):
        actions[1, 2] = np.nan
        tensors.step(torch.from_numpy(actions))
    valid = "actions.device='meta' is not valid: expected cpu."
    with pytest.raises(InvalidArgumentError, match=valid):
        tensors.step(torch.from_numpy(actions).to("meta"))
    for envs in (arrays, tensors):
        envs.close()


def _twins(task, number=3, mode="NextStep", **settings):
    """Two batches of the same environments, of NumPy arrays and of PyTorch tensors."""
    return [
        VectorEnv(
            BatchBackend(SoftGymEnv(task, **_settings(task, settings)), number, device),
            VARIATIONS,
            AutoresetMode(mode),
        )
        for device in (CpuDevice(), TorchDevice())
    ]


def _agree(arrays, tensors, where=slice(None)):
    """Checks that tensors are close to arrays where these are defined."""
    for name, array in arrays.items():
        own = np.asarray(array)[where].astype(float)
        other = tensors[name].numpy()[where].astype(float)
        np.testing.assert_allclose(other, own, rtol=1e-6, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("task, settings", [*by_material({}), ("straighten_rope", PIXELS)])
def test_tensors_say_what_arrays_say(task, settings):
    both = _twins(task, horizon=3, **settings)
    first, second = (envs.reset(seed=2) for envs in both)
    _agree(first[0], second[0])
    for actions in _actions(both[0], 5):
        first, second = both[0].step(actions), both[1].step(torch.from_numpy(actions))
        for index in (0, 4):
            _agree(first[index], second[index])
        for ours, theirs in zip(first[1:4], second[1:4], strict=True):
            np.testing.assert_allclose(theirs.numpy(), ours, rtol=1e-9, atol=1e-12)
        for name, array in first[0].items():
            assert second[0][name].dtype == torch.from_numpy(array).dtype
    for envs in both:
        envs.close()


def test_tensors_of_the_last_observations():
    both = _twins("straighten_rope", mode="SameStep", horizon=2)
    for envs in both:
        envs.reset(seed=0, options={"stagger": True})
    for actions in _actions(both[0], 4):
        first, second = (envs.step(actions)[4] for envs in both)
        assert "final_obs" in second
        ended = second["_final_obs"].numpy()
        assert ended.tolist() == first.get("_final_obs", np.zeros(3, bool)).tolist()
        for i in np.flatnonzero(ended):
            for name, array in first["final_obs"][i].items():
                other = second["final_obs"][name][i]
                np.testing.assert_allclose(other, array, rtol=1e-6, atol=1e-7)
        _agree(first.get("final_info", {}), second["final_info"], ended)
    for envs in both:
        envs.close()


def test_tensors_that_are_no_actions():
    _, envs = _twins("straighten_rope", horizon=5)
    envs.reset(seed=0)
    actions = torch.zeros(envs.action_space.shape)
    with pytest.raises(InvalidArgumentError, match=r"float32\(3, 7\)"):
        envs.step(actions[:, :7])
    with pytest.raises(InvalidArgumentError, match="int64"):
        envs.step(actions.long())
    actions[1, 2] = torch.nan
    _, _, terminated, _, infos = envs.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert infos["physics_warnings"].tolist() == [0, 1, 0]
    _, _, terminated, _, infos = envs.step(torch.zeros_like(actions))
    assert not terminated.any()
    envs.close()


@pytest.mark.parametrize(
    "task", ["straighten_rope", pytest.param("transport_water", marks=pytest.mark.long)]
)
def test_processes_read_the_same_starts(task, monkeypatch):
    monkeypatch.setattr(softgym_mj.vector.batch.initial_states, "MANY", 2)
    monkeypatch.setattr(softgym_mj.vector.batch.initial_states, "num_cores", lambda: 2)
    monkeypatch.setattr(softgym_mj.vector.batch.initial_states, "start_files", lambda *_: None)
    envs, alone = _make(task), _make(task)
    options = {"variation": VARIATIONS}
    first, _ = envs.reset(seed=0, options=options)
    alone.backend._initial_states._make = None
    second, _ = alone.reset(options=options)
    assert same(first, second)
    for actions in _actions(envs, 2):
        assert same(envs.step(actions)[0], alone.step(actions)[0])
    envs.close()
    alone.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_arrays_stay_where_they_are(mode):
    """A CUDA graph has their addresses: nothing that happens between steps moves an array."""
    _, envs = _twins("fold_cloth", mode=mode, horizon=3)
    envs.reset(seed=0, options={"variation": VARIATIONS})
    actions = torch.zeros(envs.action_space.shape)
    envs.step(actions)

    def places():
        found = leaves(envs.backend._rows.whole)
        return {(id(whole), name): array.data_ptr() for whole, name, array in found}

    before = places()
    states = envs.get_state()
    envs.step(actions)
    assert places() == before
    mask = np.array([True, False, False])
    envs.reset(seed=0, options={"variation": VARIATIONS[1], "reset_mask": mask})
    assert places() == before
    envs.reset(seed=0, options={"variation": VARIATIONS, "stagger": True})
    assert places() == before
    envs.set_state(states)
    assert places() == before
    sequences = np.zeros((3, 2, actions.shape[1]))
    envs.backend.replay([(states[0][0], sequences[:1]), (states[1][0], sequences[1:])])
    assert places() == before
    envs.close()
