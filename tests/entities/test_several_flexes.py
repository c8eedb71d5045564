"""A rope, a cloth and a garment in one scene: apart, at rest, dragged, unstretched."""

import mujoco
import numpy as np
import pytest

from softgym_mj import assets
from softgym_mj.entities import Arena, Cloth, Fabric, Garment, Rope
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.picker import ROPE_GEOMETRY, Picker
from softgym_mj.robots.workspace import Workspace

WORKSPACE = Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))


class Scene:
    """A cloth, a rope and perhaps a T-shirt on the floor, and one picker."""

    def __init__(self, shirt=False, friction=0.75, dims=(65, 65)):
        self.cloth = Cloth(dims=dims, fabric=Fabric(layer_friction=friction))
        self.rope = Rope()
        if friction < 1.0:  # The larger of two flexes counts.
            nominal = {parameter.name: parameter.nominal for parameter in self.rope.parameters}
            self.rope.adjust({**nominal, "friction": friction})
        parts = [self.cloth, self.rope]
        if shirt:
            self.shirt = Garment(assets.path("garments/t_shirt.obj"))
            parts.append(self.shirt)
        self.group = FlexGroup(parts)
        self.picker = Picker(ROPE_GEOMETRY, num_pickers=1)
        arena = Arena("cloth")
        for part in parts:
            arena.attach(part)
        self.picker.join(arena)
        self.picker.manipulate(self.group)
        self.timestep = min(part.timestep for part in parts)
        self.physics = arena.compile(self.timestep, *parts, self.picker)
        self.picker.place(np.array([[0.9, 0.9, 0.9]]), WORKSPACE)
        self.cloth.set_points(self.cloth.flat())
        self.rope.set_points(self.rope.straight() + [0.0, 0.0, 2 * self.cloth.radius])
        if shirt:
            self.shirt.set_points(self.shirt.laid() + [0.0, 0.0, 0.03])
        self.crossings = 0
        self.rope_strain, self.cloth_strain = [], []

    def step(self, count=1, action=(0.0, 0.0, 0.0, -1.0)):
        """Sim steps with the picker's action."""
        self.picker.command(np.array(action))
        steps = round(SIM_STEP / self.timestep)
        for _ in range(count):
            self.picker.plan()
            for i in range(steps):
                self.picker.move((i + 1) / steps, self.timestep)
                mujoco.mj_step(self.physics.model.ptr, self.physics.data.ptr)
            self.rope_strain.append(np.abs(self.rope.edge_strain()).max())
            self.cloth_strain.append(np.percentile(np.abs(self.cloth.edge_strain()), 99))
            if len(self.rope_strain) % 5 == 0:
                self.crossings = max(self.crossings, self.intersections())

    def intersections(self):
        """Edges of the rope and all sheets that cross a triangle of any sheet."""
        first, edges, triangles = 0, [], []
        for flex in self.group.flexes:
            edges.append(flex.edges + first)
            if flex is not self.rope:
                triangles.append(flex.triangles + first)
            first += flex.num_points
        edges, triangles = np.concatenate(edges), np.concatenate(triangles)
        return count_intersections(self.group.points(), edges, triangles)

    def rope_speed(self):
        """Returns the speed of its fastest vertex [m/s], averaged over 0.1 s."""
        before = self.rope.points()
        self.step(10)
        return np.abs(self.rope.points() - before).max() / 0.1

    @property
    def warnings(self):
        return self.physics.data.ptr.warning.number.sum()


def test_a_rope_lies_on_a_cloth_at_the_sum_of_their_radii():
    scene = Scene()
    scene.step(100)
    rope, cloth = scene.rope.points(), scene.cloth.points()
    inside = np.abs(rope[:, 0]) < 0.15  # The cloth is 0.4 m wide, the rope 0.5 m long.
    resting = 2 * scene.cloth.radius + scene.rope.radius
    np.testing.assert_allclose(rope[inside, 2], resting, atol=1.5e-3)
    np.testing.assert_allclose(cloth[:, 2], scene.cloth.radius, atol=3e-3)
    assert scene.rope_speed() < 1e-3
    assert scene.crossings == 0 and scene.warnings == 0
    assert max(scene.cloth_strain) < 0.02


def test_only_flexes_that_carry_the_plugin_touch():
    """The contact that is tested above does not come from elsewhere."""
    arena = Arena("cloth")
    cloth, rope = Cloth(dims=(65, 65)), Rope()
    for part in (cloth, rope):
        arena.attach(part)
    rope.mjcf_model.worldbody.flexcomp[0].plugin[0].remove()
    physics = arena.compile(0.01, cloth, rope)
    cloth.set_points(cloth.flat() + [0.0, 0.0, 0.1])
    rope.set_points(rope.straight() + [0.0, 0.0, 0.13])
    for vertex in cloth.corners:
        cloth.hold(int(vertex))
    for _ in range(30):
        for vertex in cloth.corners:
            cloth.drive(int(vertex), cloth.vertex(int(vertex)), 0.01)
        mujoco.mj_step(physics.model.ptr, physics.data.ptr)
    assert rope.points()[:, 2].max() < cloth.points()[:, 2].min()


def test_a_rope_dropped_onto_a_cloth_comes_to_rest_on_it():
    scene = Scene()
    lifted = scene.rope.straight()[:, [1, 0, 2]] + [0.0, 0.0, 0.3]
    scene.rope.set_points(lifted)
    scene.step(200)
    assert scene.crossings == 0 and scene.warnings == 0
    assert max(scene.rope_strain) < 0.3  # It lands at 2.4 m/s.
    assert scene.rope_strain[-1] < 0.02 and scene.cloth_strain[-1] < 0.02
    assert scene.rope_speed() < 0.02  # Where it lies on itself it goes on slipping for seconds.
    assert np.median(scene.rope.points()[:, 2]) == pytest.approx(0.016, abs=2e-3)


def test_a_picker_drags_a_rope_over_a_cloth_and_lifts_it():
    scene = Scene()
    scene.step(20)
    end = scene.rope.num_points - 1
    start = scene.rope.vertex(end) + [0.0, 0.0, scene.picker.radius + scene.rope.radius]
    scene.picker.place(start[None], WORKSPACE)
    scene.step(1, (0.0, 0.0, 0.0, 1.0))
    flex, vertex = scene.group.owner(int(scene.picker.held[0]))
    assert flex is scene.rope and vertex == end
    for action in ((0.0, 0.0, 0.5, 1.0), (-0.5, 0.3, 0.0, 1.0), (0.0, -0.6, 0.2, 1.0)):
        scene.step(40, action)
        held, goal = scene.rope.vertex(end), scene.picker.held_positions()[0]
        np.testing.assert_allclose(held, goal, atol=2e-3)
    assert scene.crossings == 0 and scene.warnings == 0
    assert np.percentile(scene.rope_strain, 90) < 0.25
    assert max(scene.cloth_strain) < 0.12
    scene.step(60)
    assert scene.rope_strain[-1] < 0.02


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_a_rope_that_slides_on_a_cloth_stops_after_coulombs_way(friction):
    scene = Scene(friction=friction, dims=(113, 33))  # 0.7 m x 0.2 m.
    rest = scene.cloth.points()
    for vertex in range(scene.cloth.num_points):
        scene.cloth.hold(vertex)
    # At 0.5 m/s it stops after 0.7 to 0.8 of this way: edges of the mesh are bumps.
    speed = 0.15
    start = scene.rope.points()
    scene.rope.set_points(start, np.tile([speed, 0.0, 0.0], (len(start), 1)))
    for _ in range(round(0.5 / scene.timestep)):
        for vertex, place in enumerate(rest):
            scene.cloth.drive(vertex, place, scene.timestep)
        mujoco.mj_step(scene.physics.model.ptr, scene.physics.data.ptr)
    way = (scene.rope.points() - start)[:, 0].mean()
    assert way == pytest.approx(speed**2 / (2 * friction * 9.8), rel=0.15)
    assert np.abs(scene.rope.velocities()[:, 0]).max() < 0.01


def test_a_t_shirt_falls_onto_a_rope_on_a_cloth():
    scene = Scene(shirt=True)
    scene.step(50)
    assert scene.crossings == 0 and scene.warnings == 0
    assert max(scene.cloth_strain) < 0.05
    # Where the rope lies below it, the shirt is higher than its two layers alone.
    shirt = scene.shirt.points()
    over = (np.abs(shirt[:, 1]) < 0.02) & (np.abs(shirt[:, 0]) < 0.1)
    assert shirt[over, 2].max() > 2 * scene.cloth.radius + 4 * scene.shirt.radius


def test_vertices_of_a_group_are_those_of_its_flexes():
    scene = Scene()
    group, cloth, rope = scene.group, scene.cloth, scene.rope
    n = cloth.num_points
    assert group.num_points == n + rope.num_points
    np.testing.assert_array_equal(group.points()[n:], rope.points())
    np.testing.assert_array_equal(group.vertex(n + 3), rope.vertex(3))
    point = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(group.displacements_from(point), group.points() - point, atol=1e-12)
    heights = [group.resting_height(vertex) for vertex in (n - 1, n)]
    assert heights == [cloth.radius, rope.radius]
    assert group.radius == rope.radius
    assert group.owner(0) == (cloth, 0)
    with pytest.raises(InvalidArgumentError, match=f"index={group.num_points}"):
        group.owner(group.num_points)


def test_a_picker_holds_a_vertex_of_each_flex_at_its_own_height():
    """Pressed against the floor, a vertex stays at the radius of its own flex."""
    scene = Scene()
    for index in (0, scene.cloth.num_points):  # A corner of the cloth, an end of the rope.
        scene.picker.place(scene.group.vertex(index)[None] + [0.0, 0.0, 0.03], WORKSPACE)
        scene.picker.take([index])
        scene.step(4, (0.0, 0.0, -1.0, 1.0))
        flex, _ = scene.group.owner(index)
        assert scene.picker.held_positions()[0, 2] == flex.radius
        assert scene.group.vertex(index)[2] == pytest.approx(flex.radius, abs=1e-3)
