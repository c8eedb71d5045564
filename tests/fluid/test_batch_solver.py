"""`FluidBatchSolver`, whose oracle is the plugin: the same bits."""

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.fluid import load_plugin
from softgym_mj.fluid.batch_solver import NOT_FINITE, TOO_MANY_NEIGHBORS, FluidBatchSolver, describe

HELD_FLOOR = 1  # The floor of a cup in a hand is the second wall, without an offset.


class _Followed:
    """An environment with cups, and what environments are told to do the same."""

    def __init__(self, task, variation, **settings):
        self.env = softgym_mj.load(task, split="all", fidelity="fast", **settings)
        self.env.reset(variation)
        self.cups = self.env.task.scene.cups
        self.water = next(iter(self.env.task.scene.materials.values()))
        self.pushes = bool(self.env.task.actor.wrists)  # An arm holds the cup.

    @property
    def model(self):
        model = self.env.physics.model.ptr
        return describe(model, [model.body(cup.body.full_identifier).id for cup in self.cups])

    @property
    def state(self):
        """State of the plugin by name."""
        own = dict(self.water.state)
        rest = own.pop("rest")
        # Poses, forces and impulses of each wall.
        walls = len(rest) // (7 + 6 + 6 if self.pushes else 7)
        poses, forces, pending = np.split(rest, [7 * walls, 13 * walls])
        return {
            **own,
            "walls": poses.reshape(-1, 7),
            "forces": forces.reshape(-1, 6),
            "pending": pending.reshape(-1, 6),
        }

    def place(self, solver, i):
        """Puts row `i` of the batch where the environment is."""
        solver.start(i, self.model)
        solver.set_state(i, self.state)

    def steps(self, number, seed=0):
        """Plays random env steps; yields the inputs of each physics step after it."""
        task, physics = self.env.task, self.env.physics
        size = (number, *self.env.action_spec().shape)
        for action in np.random.default_rng(seed).uniform(-1.0, 1.0, size):
            task.before_step(physics, action, None)
            for _ in range(task.action_repeat):
                task.before_substep(physics, action, None)
                physics.step()
                mobility = self._mobility()
                yield self._poses(), mobility
            task.after_step(physics, None)

    def _poses(self):
        poses = np.array([cup.whole_pose[:7] for cup in self.cups])
        if self.pushes:  # Those of the plugin differ from MuJoCo's by rounding.
            own = self.state["walls"][HELD_FLOOR]
            np.testing.assert_allclose(own[:3], poses[0, :3], atol=1e-12)
            poses[0] = own
        return poses

    def _mobility(self):
        """How easily a cup in a hand moves and turns."""
        found = np.zeros((len(self.cups), 2))
        if self.pushes:
            model, data = self.env.physics.model.ptr, self.env.physics.data.ptr
            body = model.body(self.cups[0].body.full_identifier).id
            jacobian, solved = np.empty((2, 6, model.nv))
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], data.xipos[body], body)
            mujoco.mj_solveM(model, data, solved, jacobian)
            each = [mujoco.mju_dot(*rows) for rows in zip(jacobian, solved, strict=True)]
            found[0] = max(each[:3]), max(each[3:])
        return found

    def check(self, solver, i):
        """Checks that row `i` of the batch equals the environment bit by bit."""
        state = solver.get_state(i)
        for name, array in self.state.items():
            np.testing.assert_array_equal(state[name], array, err_msg=name)


class _Spoilt(FluidBatchSolver):
    """Finds anything in its memory."""

    def _step(self, **told):
        self._memory[...] = 255  # Not a number, and no index.
        super()._step(**told)


def _solver(followed, device=None):
    count = max(each.water.num_points for each in followed)
    first = followed[0]
    solver = _Spoilt(len(followed), count, len(first.cups), device, first.pushes)
    for i, each in enumerate(followed):
        each.place(solver, i)
    return solver


def _step(solver, *told):
    """Makes a step with inputs of environments."""
    solver.step(*(np.stack(arrays) for arrays in zip(*told, strict=True)))


@pytest.mark.parametrize(
    ("task", "settings"),
    [("transport_water", {}), ("pour_water", {}), ("pour_water", {"actor": "franka"})],
)
def test_an_environment_makes_the_steps_of_the_plugin(task, settings):
    followed = _Followed(task, 806, **settings)
    solvers = [_solver([followed], CpuDevice(turns=turns)) for turns in (0, 1, 4)]
    for told in followed.steps(4):
        for solver in solvers:
            _step(solver, told)
            followed.check(solver, 0)
    assert not any(solver.flags[0] for solver in solvers)
    assert np.any(solvers[0].forces) == followed.pushes


def test_particles_in_one_place_part_alike():
    followed = _Followed("transport_water", 806)
    followed.state["positions"][5] = followed.state["positions"][9]
    followed.state["velocities"][5] = followed.state["velocities"][9]
    solver = _solver([followed], CpuDevice(turns=2))
    for told in followed.steps(1):
        _step(solver, told)
        followed.check(solver, 0)
    apart = solver.positions[0, 5] - solver.positions[0, 9]
    assert 1e-5 < np.linalg.norm(apart) < 0.1


@pytest.mark.parametrize("settings", [{}, {"actor": "sawyer"}])
def test_environments_of_different_sizes_side_by_side(settings):
    followed = [_Followed("pour_water", i, **settings) for i in (801, 803, 810)]
    assert len({each.water.num_points for each in followed}) == 3
    solver = _solver(followed, CpuDevice(num_threads=2))
    for told in zip(*(each.steps(2) for each in followed), strict=True):
        _step(solver, *told)
    for i, each in enumerate(followed):
        each.check(solver, i)


def test_what_goes_wrong_in_an_environment_changes_no_other():
    followed = _Followed("transport_water", 806)
    solver = _solver([followed] * 3)
    solver.velocities[0, 3] = np.nan
    solver.positions[2, :300] = solver.positions[2, 0]
    for told in followed.steps(1):
        _step(solver, *[told] * 3)
    followed.check(solver, 1)
    assert solver.flags[0] & NOT_FINITE
    assert solver.flags[1] == 0
    assert solver.flags[2] & TOO_MANY_NEIGHBORS


_LAKE = """<mujoco>
  <extension><plugin plugin="softgym_mj.fluid"><instance name="water">
    <config key="count" value="65536"/> <config key="columns" value="256 256"/>
  </instance></plugin></extension>
  <worldbody><body mocap="true"><geom size="1"/><plugin instance="water"/></body></worldbody>
</mujoco>"""


def test_more_particles_than_lists_can_name_are_refused():
    load_plugin()
    lake = mujoco.MjModel.from_xml_string(_LAKE)
    with pytest.raises(InvalidArgumentError, match="at most 65535 particles"):
        describe(lake, [])


def test_what_does_not_fit_is_refused():
    rope = softgym_mj.load("straighten_rope", split=[800])
    with pytest.raises(InvalidArgumentError, match="there is no water"):
        describe(rope.physics.model.ptr, [])
    arm = _Followed("transport_water", 800, actor="franka")
    with pytest.raises(InvalidArgumentError, match="'pushed': 0"):
        FluidBatchSolver(1, 10_000, 1).start(0, arm.model)
    followed = _Followed("transport_water", 806)
    model = followed.env.physics.model.ptr
    with pytest.raises(InvalidArgumentError, match="prescribed motion"):
        describe(model, [])
    with pytest.raises(InvalidArgumentError, match="'particles': 10"):
        FluidBatchSolver(1, 10, 1).start(0, followed.model)
    with pytest.raises(LifecycleError, match="no model"):
        FluidBatchSolver(1, 10, 1).get_state(0)
