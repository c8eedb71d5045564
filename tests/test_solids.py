"""What lies on own rods and boards: `Arena.add_solid`."""

import numpy as np
import pytest

from softgym_mj.entities import Arena, Cloth, Rope
from softgym_mj.environment import Environment
from softgym_mj.exceptions import OutOfRangeError, UnknownNameError
from softgym_mj.robots.factory import make_gripper
from softgym_mj.tasks import Evaluation, SceneTask

HEIGHT = 0.5  # [m] Of the middle of a rod or board.
SHAPES = {
    "rod": lambda half: {
        "type": "capsule", "fromto": (0, -0.4, HEIGHT, 0, 0.4, HEIGHT), "size": (half,)
    },
    "board": lambda half: {"type": "box", "pos": (0, 0, HEIGHT), "size": (0.4, 0.4, half)},
}  # fmt: skip


def height_after_a_fall(thing, shape: str, half: float, fall: float, timestep: float) -> float:
    """Height [m] of the highest vertex above the shape, a second after it was let go."""
    arena = Arena(camera="cloth")
    arena.attach(thing)
    arena.add_solid(**SHAPES[shape](half))
    physics = arena.compile(timestep, thing)
    vertices = thing.flat() if isinstance(thing, Cloth) else thing.straight()
    with physics.reset_context():
        thing.set_vertices(vertices + [0.0, 0.0, HEIGHT + half + fall])
    physics.step(round(1.0 / timestep))
    return thing.vertices()[:, 2].max() - HEIGHT - half


@pytest.mark.parametrize("fall", [0.02, 0.06, 0.15])
@pytest.mark.parametrize(("shape", "half"), [("rod", 0.004), ("rod", 0.015), ("board", 0.008)])
def test_a_rope_stays_where_it_falls(shape, half, fall):
    rope = Rope()
    left = height_after_a_fall(rope, shape, half, fall, rope.timestep)
    assert 0.7 * rope.radius < left < 4 * rope.radius  # It may lie on itself.


@pytest.mark.parametrize(
    ("timestep", "half", "fall"),
    # What docs/physics.md says: how far it may fall with the usual step, and with half of it.
    [(0.01, 0.004, 0.02), (0.01, 0.008, 0.06), (0.005, 0.004, 0.15), (0.005, 0.008, 0.3)],
)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_cloth_stays_where_it_falls(shape, timestep, half, fall):
    cloth = Cloth((60, 60))
    left = height_after_a_fall(cloth, shape, half, fall, timestep)
    assert 0.5 * cloth.radius < left < 1.5 * cloth.radius


class Shelf(SceneTask):
    """A rope on a shelf."""

    def __init__(self, actor: str, **settings):
        self.rope = Rope("fast")
        super().__init__([self.rope], make_gripper(actor, "rope"), **settings)
        self.root_entity.add_solid("box", pos=(0, 0, 0.05), size=(0.3, 0.5, 0.05))

    def arrange(self, random):
        self.rope.set_vertices(self.rope.straight() + [0.0, 0.0, 0.1])

    def evaluate(self):
        return Evaluation(0.0, {"none": 0.0})


@pytest.mark.parametrize("actor", ["franka", "sawyer"])
def test_hands_stop_at_a_shelf(actor):
    env = Environment(Shelf(actor), name="shelf", horizon=30)
    env.reset(0)
    for _ in range(30):
        env.step(np.array([0.0, 0.0, -1.0, -1.0] * 2))
    assert (np.abs(env.task.actor.positions()[:, 2] - 0.1) < 0.02).all()
    assert env.task.rope.vertices()[:, 2].min() > 0.1


def test_a_task_may_have_a_smaller_physics_step():
    env = Environment(Shelf("picker", timestep=0.0025), name="shelf", horizon=2)
    env.reset(0)
    env.step(np.zeros(8))
    assert env.physics.model.opt.timestep == 0.0025
    assert env.physics.time() == pytest.approx(env.control_timestep())
    for timestep in (0.01, 0.004, 0.0, -0.005, float("nan")):  # A rope needs 0.005 s or less.
        with pytest.raises(OutOfRangeError, match=f"timestep={timestep}"):
            Shelf("picker", timestep=timestep)


def test_shapes_without_an_extent_are_refused():
    with pytest.raises(UnknownNameError, match="type='plane'"):
        Arena(camera="cloth").add_solid("plane", size=(1, 1, 1))
