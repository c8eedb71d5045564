"""Cloth and rope on custom rods and boards: `Arena.add_solid`."""

import numpy as np
import pytest

from softgym_mj.entities import Arena, Cloth, Fabric, Rope
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks import Measures, Task

HEIGHT = 0.5  # [m] Height of the middle of a rod or board.
# [m] Distance of a rod from the middle row of a cloth's vertices, which are 3.1 cm apart.
BESIDE = 0.0155


slow = pytest.mark.slow


def rod(type: str, radius: float, x: float = 0.0) -> dict:
    ends = (x, -0.4, HEIGHT, x, 0.4, HEIGHT)
    return {"type": type, "fromto": ends, "size": (radius,)}


def board(half: float) -> dict:
    return {"type": "box", "pos": (0, 0, HEIGHT), "size": (0.4, 0.4, half)}


def height_after_a_fall(thing, solid: dict, half: float, fall: float, timestep: float) -> float:
    """Height [m] of the highest vertex above a solid, a second after it was let go."""
    arena = Arena("cloth")
    arena.attach(thing)
    arena.add_solid(**solid)
    physics = arena.compile(timestep, thing)
    vertices = thing.flat() if isinstance(thing, Cloth) else thing.straight()
    with physics.reset_context():
        thing.set_points(vertices + [0.0, 0.0, HEIGHT + half + fall])
    physics.step(round(1.0 / timestep))
    return thing.points()[:, 2].max() - HEIGHT - half


@pytest.mark.parametrize("fall", [pytest.param(0.02, marks=slow), 0.15])
@pytest.mark.parametrize(
    ("solid", "half"),
    [
        (rod("capsule", 0.004), 0.004),
        (rod("cylinder", 0.004, x=0.006), 0.004),
        (board(0.008), 0.008),
    ],
    ids=["capsule", "cylinder", "board"],
)
def test_a_rope_stays_where_it_falls(solid, half, fall):
    rope = Rope()
    left = height_after_a_fall(rope, solid, half, fall, rope.timestep)
    assert 0.7 * rope.radius < left < 4 * rope.radius  # It may lie on itself.


@pytest.mark.parametrize("x", [0.0, BESIDE])
@pytest.mark.parametrize(
    ("timestep", "radius", "fall"),
    [
        (0.01, 0.004, 0.3),
        (0.01, 0.025, 0.3),
        pytest.param(0.01, 0.004, 0.06, marks=slow),
        pytest.param(0.005, 0.004, 0.3, marks=slow),
    ],
)
@pytest.mark.parametrize("type", ["capsule", "cylinder"])
def test_a_cloth_stays_on_the_rod_where_it_falls(type, timestep, radius, fall, x):
    cloth = Cloth(dims=(60, 60), fabric=Fabric(drag=0.0))  # In air its rim would be there first.
    left = height_after_a_fall(cloth, rod(type, radius, x), radius, fall, timestep)
    # Its triangles lie on the rod, a vertex in the middle of one, at most, 15.5 mm beside it.
    farthest = np.hypot(radius + cloth.radius, BESIDE) - radius
    assert 0.5 * cloth.radius < left < farthest + 0.5 * cloth.radius


@pytest.mark.parametrize(
    ("timestep", "half", "fall"),
    [
        (0.01, 0.004, 0.3),
        (0.01, 0.025, 0.3),
        pytest.param(0.01, 0.008, 0.06, marks=slow),
        pytest.param(0.005, 0.008, 0.3, marks=slow),
    ],
)
def test_a_cloth_stays_on_the_board_where_it_falls(timestep, half, fall):
    cloth = Cloth(dims=(60, 60), fabric=Fabric(drag=0.0))
    left = height_after_a_fall(cloth, board(half), half, fall, timestep)
    assert 0.5 * cloth.radius < left < 1.5 * cloth.radius


class Shelf(Task):
    """A rope on a shelf."""

    material = "rope"

    def __init__(self, actor: str, **settings):
        self.rope = Rope("fast")
        super().__init__([self.rope], actor=actor, **settings)
        self.root_entity.add_solid("box", pos=(0, 0, 0.05), size=(0.3, 0.5, 0.05))

    def arrange(self, random):
        self.rope.set_points(self.rope.straight() + [0.0, 0.0, 0.1])

    def measure(self, state, episode):
        return Measures(0.0, {"none": 0.0})


@pytest.mark.parametrize("actor", ["franka", pytest.param("sawyer", marks=slow)])
def test_hands_stop_at_a_shelf(actor):
    env = Environment(Shelf(actor), name="shelf", horizon=30)
    env.reset(0)
    for _ in range(30):
        env.step(np.array([0.0, 0.0, -1.0, -1.0] * 2))
    assert (np.abs(env.task.actor.positions()[:, 2] - 0.1) < 0.02).all()
    assert env.task.rope.points()[:, 2].min() > 0.1


def test_a_task_may_have_a_smaller_physics_step():
    env = Environment(Shelf("picker", timestep=0.0025), name="shelf", horizon=2)
    env.reset(0)
    env.step(np.zeros(8))
    assert env.physics.model.opt.timestep == 0.0025
    assert env.physics.time() == pytest.approx(env.control_timestep())
    for timestep in (0.02, 0.004, 0.0, -0.005, float("nan")):  # A sim step is 0.01 s.
        with pytest.raises(InvalidArgumentError, match=f"timestep={timestep}"):
            Shelf("picker", timestep=timestep)


def test_shapes_without_an_extent_are_refused():
    with pytest.raises(InvalidArgumentError, match="type='plane'"):
        Arena("cloth").add_solid("plane", size=(1, 1, 1))
