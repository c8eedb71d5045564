"""Cloth on a mesh and a rope on a heightfield in a batch: its bits are those of the environment."""

from typing import Unpack

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities import Cloth, Rope
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks import Measures, Task, TaskSettings
from tests.scenes import solid_meshes

SETTINGS = {"observation": "full", "split": "all", "horizon": 12}
VARIATIONS = [803, 811, 804]


class _OnBunny(Task):
    """Cloth over a mesh of 5,120 triangles, whose friction varies."""

    material, horizon = "cloth", 12

    def __init__(self, **settings: Unpack[TaskSettings]):
        self.cloth = Cloth(dims=(17, 17), fidelity="fast")
        super().__init__([self.cloth], **settings)
        vertices, faces = solid_meshes.bunny()
        mesh = self.root_entity.mjcf_model.asset.add(
            "mesh", name="bunny", vertex=vertices.ravel(), face=faces.ravel()
        )
        self._solid = self.root_entity.add_solid("mesh", mesh=mesh, pos=(0.0, 0.0, 0.1))

    def resize(self, variation):
        self._solid.friction = [0.1 * (variation % 10 + 1), 0.0, 0.0]
        super().resize(variation)
        return True

    def arrange(self, random):
        angle = random.uniform(-1.0, 1.0)
        self.cloth.set_points(self.cloth.flat(angle=angle) + [0.0, 0.0, 0.3])

    def measure(self, state, episode):
        height = state.points["cloth"][..., 2].mean(-1)
        return Measures(height, {"height": height})


class _OnHills(Task):
    """Rope on a heightfield."""

    material, horizon = "rope", 12

    def __init__(self, **settings: Unpack[TaskSettings]):
        self.rope = Rope("fast")
        super().__init__([self.rope], **settings)
        heights = np.random.default_rng(0).random((21, 21))
        field = self.root_entity.mjcf_model.asset.add(
            "hfield", name="hills", nrow=21, ncol=21, size=(0.5, 0.5, 0.05, 0.01),
            elevation=heights.ravel(),
        )  # fmt: skip
        self.root_entity.add_solid("hfield", hfield=field)

    def arrange(self, random):
        self.rope.set_points(self.rope.straight() + [0.0, random.uniform(-0.2, 0.2), 0.08])

    def measure(self, state, episode):
        height = state.points["rope"][..., 2].mean(-1)
        return Measures(height, {"height": height})


class _BelowBall(_OnHills):
    """Rope that a moving body may fall on."""

    def __init__(self, **settings: Unpack[TaskSettings]):
        super().__init__(**settings)
        ball = self.root_entity.mjcf_model.worldbody.add("body", name="ball", pos=(0.0, 0.0, 0.5))
        ball.add("freejoint")
        ball.add("geom", type="sphere", size=[0.05])


TASKS = {"on_bunny": _OnBunny, "on_hills": _OnHills}


@pytest.fixture(name="task", params=TASKS)
def _task(request, register):
    register(request.param, TASKS[request.param])
    return request.param


def test_rows_are_environments(task):
    envs = softgym_mj.make_vec(task, len(VARIATIONS), device="host", **SETTINGS)
    observations, _ = envs.reset(seed=0, options={"variation": VARIATIONS})
    alone = [SoftGymEnv(task, **SETTINGS) for _ in VARIATIONS]
    for i, env in enumerate(alone):
        observation, _ = env.reset(options={"variation": VARIATIONS[i]})
        np.testing.assert_array_equal(observations[i], observation)
    random, solver = np.random.default_rng(0), envs.backend._physics._solver
    touched = np.zeros(len(VARIATIONS), bool)
    for _ in range(10):
        actions = random.uniform(-1.0, 1.0, envs.action_space.shape).astype(np.float32)
        observations, rewards, _, _, infos = envs.step(actions)
        touched |= solver.solid_forces.any(axis=(1, 2))
        for i, env in enumerate(alone):
            observation, reward, _, _, info = env.step(actions[i])
            np.testing.assert_array_equal(observations[i], observation)
            assert rewards[i] == pytest.approx(reward, rel=1e-12)
            assert infos["physics_warnings"][i] == info["physics_warnings"] == 0
    assert touched.all()
    assert solver.flags.tolist() == [0] * len(VARIATIONS)
    envs.close()


def test_a_snapshot_continues_anywhere(task):
    envs = softgym_mj.make_vec(task, 2, device="host", **SETTINGS)
    env = SoftGymEnv(task, **SETTINGS)
    envs.reset(seed=0, options={"variation": VARIATIONS[:2]})
    action = np.zeros(envs.action_space.shape, np.float32)
    for _ in range(4):
        envs.step(action)
    env.reset(options={"variation": VARIATIONS[2]})
    env.set_state(envs.get_state()[1])
    for _ in range(3):
        np.testing.assert_array_equal(env.step(action[1])[0], envs.step(action)[0][1])
    envs.close()


def test_variations_of_worker_processes_share_a_grid(register, monkeypatch):
    monkeypatch.setattr(softgym_mj.vector.batch.initial_states, "MANY", 2)
    register("on_bunny", _OnBunny)
    envs = softgym_mj.make_vec("on_bunny", len(VARIATIONS), device="host", **SETTINGS)
    envs.reset(seed=0, options={"variation": VARIATIONS})
    solver = envs.backend._physics._solver
    assert len(set(solver.models.tolist())) == len(VARIATIONS)
    assert len(solver._grids) == 1
    envs.close()


def test_scenes_with_other_moving_bodies_are_refused(register):
    register("below_ball", _BelowBall)
    with pytest.raises(InvalidArgumentError, match=r"task='below_ball'.*moving bodies \['ball'\]"):
        softgym_mj.make_vec("below_ball", 2, device="host")


def test_arms_and_images_that_batches_lack_are_refused(register):
    pytest.importorskip("jax", reason="needs the extra gpu-arms")
    for name, task in TASKS.items():
        register(name, task)
    with pytest.raises(InvalidArgumentError, match=r"franka.*in a scene with fixed solids"):
        softgym_mj.make_vec("on_bunny", 2, device="host", actor="franka")
    with pytest.raises(InvalidArgumentError, match="HFIELD"):
        softgym_mj.make_vec("on_hills", 2, device="host", observation="rgb").reset(seed=0)
