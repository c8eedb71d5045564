"""Twist of ropes against closed forms, explicit frames and conservation laws."""

import math

import mujoco
import numpy as np
import pytest

from tests.cloth.flex_scene import Flex, FlexScene, rope, straight
from tests.cloth.twisted import BEND, TWIST, angle_of, wavy
from tests.oracles.rods import greenhill, reference_twist, transported, unit, writhe

STILL = (0.0, 0.0, 0.0)  # [m/s^2] Gravity.
RADIUS, COUNT = 0.1, 40  # [m], vertices of the ring.
DENSITY = 0.1  # [kg/m]
SOFT = 1e-3  # [N] A rope that hardly resists stretch.


def ring(**material) -> Flex:
    """A closed ring in the XY plane."""
    angle = 2.0 * np.pi * np.arange(COUNT) / COUNT
    points = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    made_of = {"stretch": 500, "stretch_damping": 0.0, "bend": BEND, "bend_damping": 0.0,
               "twist": TWIST, **material}  # fmt: skip
    elements = np.column_stack([np.arange(COUNT), (np.arange(COUNT) + 1) % COUNT])
    return Flex(points, elements, DENSITY * 2.0 * np.pi * RADIUS, made_of, radius=0.002)


def deviation(scene: FlexScene, angle: float, steps: int) -> tuple[float, float]:
    """Distance [m] of a rope from a line or plane halfway and at the end of some steps.

    Args:
        scene: A rope along X or a ring in the XY plane.
        angle: Its twist [rad].
        steps: Number of steps.
    """
    found = []
    angle_of(scene)[0] = angle
    for _ in range(2):
        largest = 0.0
        for _ in range(steps // 2):
            scene.step()
            largest = max(largest, float(np.abs(scene.positions()[:, 2]).max()))
        found.append(largest)
    return found[0], found[1]


# ------------------------------------------------------------------ forces


@pytest.mark.parametrize("angle", [-2.5, 5.0])
def test_forces_are_the_gradient_of_the_energy(angle):
    """Against differences of the twist of explicit frames; end frames move without spin."""
    points = wavy()
    flex = rope(points, bend=0.0, stretch=SOFT, stretch_damping=0.0, radius=1e-4,
                twist=TWIST, twist_clamped=1)  # fmt: skip
    scene = FlexScene(
        flex, floor=False, gravity=STILL, settings='<config key="substeps" value="1"/>'
    )
    scene.model.opt.timestep = step = 1e-5
    angle_of(scene)[0] = angle
    mujoco.mj_step(scene.model, scene.data)
    forces = scene.mass[:, None] * scene.data.qvel[scene.dofs] / step

    tangents = unit(np.diff(points, axis=0))
    ends = [np.cross(tangents[i], [0.3, 0.2, 0.9]) for i in (0, -1)]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    stiffness = TWIST / (lengths.sum() - (lengths[0] + lengths[-1]) / 2.0)

    def twist(moved: np.ndarray) -> float:
        now = unit(np.diff(moved, axis=0))
        first, last = (
            transported(unit(end), tangents[i], now[i])
            for end, i in zip(ends, (0, -1), strict=True)
        )
        return reference_twist(moved, first, last)

    expected, change = np.zeros_like(points), 1e-6
    for vertex in np.ndindex(points.shape):
        moved = np.zeros_like(points)
        moved[vertex] = change
        slope = (twist(points + moved) - twist(points - moved)) / (2.0 * change)
        expected[vertex] = -stiffness * angle * slope
    np.testing.assert_allclose(forces, expected, atol=2e-3 * np.abs(expected).max())
    assert np.abs(forces.sum(axis=0)).max() < 1e-4 * np.abs(forces).max()


def test_the_angle_follows_the_frames_of_held_ends():
    scene = FlexScene(rope(wavy(), twist=1e-6, radius=1e-3), floor=False, gravity=STILL)
    scene.hold(0, 1, 10, 11)
    tangents = unit(np.diff(scene.positions(), axis=0))
    ends = [unit(np.cross(tangents[i], [0.3, 0.2, 0.9])) for i in (0, -1)]
    before = reference_twist(scene.positions(), *ends)
    angle_of(scene)[0] = 1.0
    for step in range(100):
        turn = 0.1 * np.array([np.sin(0.1 * step), np.cos(0.1 * step), 0.3])
        scene.step_each({11: turn, 10: -0.5 * turn})
        now = unit(np.diff(scene.positions(), axis=0))
        ends = [transported(ends[i], tangents[i], now[i]) for i in (0, -1)]
        tangents = now
    after = reference_twist(scene.positions(), *ends)
    turned = angle_of(scene)[0] - 1.0 - (after - before)
    # The angle follows the path of the substeps, the reference that of the steps.
    assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=5e-3)
    assert abs(after - before) > 0.05


# ------------------------------------------------------------------ instabilities


@pytest.mark.parametrize("ratio", [0.5, 1.0])
def test_a_ring_buckles_at_the_twist_of_michell(ratio):
    """2 pi sqrt(3) times bending over twist stiffness (Michell, 1889)."""
    critical = 2.0 * np.pi * np.sqrt(3.0) / ratio
    for share, grows in ((0.95, False), (1.05, True)):
        scene = FlexScene(ring(twist=ratio * BEND), floor=False, gravity=STILL)
        points = scene.positions()
        around = np.arctan2(points[:, 1], points[:, 0])
        points[:, 2] = 1e-5 * np.cos(2.0 * around)
        scene.place(points)
        early, late = deviation(scene, share * critical, 300)
        assert (late > 3.0 * early) == grows
        assert late < 2.0 * early or grows


def test_the_critical_moment_without_tension_is_known():
    assert greenhill(1e-6) == pytest.approx(2.861 * np.pi, rel=2e-3)


@pytest.mark.parametrize("tension", [1e-6, 20.0])
def test_a_clamped_rod_buckles_at_the_moment_of_greenhill(tension):
    count, spacing = 42, 0.0125
    length = (count - 2) * spacing  # Clamped edges bend over half their length.
    stretch = 50.0
    strain = tension * BEND / length**2 / stretch
    critical = greenhill(tension) * BEND / TWIST
    for share, grows in ((0.95, False), (1.05, True)):
        flex = rope(straight(count, spacing), bend=BEND, bend_damping=0.0, radius=1e-3,
                    stretch=stretch, twist=TWIST)  # fmt: skip
        scene = FlexScene(flex, floor=False, gravity=STILL)
        points = (1.0 + strain) * scene.positions()
        points[2:-2, 2] = 1e-5 * np.sin(np.pi * np.linspace(0.0, 1.0, count - 4)) ** 2
        scene.place(points)
        scene.hold(0, 1, count - 2, count - 1)
        early, late = deviation(scene, share * critical, 600)
        assert (late > 3.0 * early) == grows


# ------------------------------------------------------------------ conservation


def perturbed(speed: float) -> FlexScene:
    """A ring beyond Michell's twist, with random velocities [m/s], after a step."""
    scene = FlexScene(ring(), floor=False, gravity=STILL)
    random = np.random.default_rng(0).normal(size=(COUNT, 3))
    scene.data.qvel[scene.dofs] = speed * random
    angle_of(scene)[0] = 5.0 * np.pi
    scene.step()
    return scene


def test_a_writhing_ring_keeps_its_link():
    """The sum of twist and writhe [turns] (Calugareanu, 1961), by the Gauss integral."""
    scene = perturbed(0.3)

    def link() -> float:
        return angle_of(scene)[0] / (2.0 * np.pi) + writhe(scene.positions())

    linked = link()
    scene.step(60)
    assert abs(writhe(scene.positions())) > 0.5
    assert link() == pytest.approx(linked, abs=1e-9)


def test_a_writhing_ring_keeps_its_momenta():
    """Angular momentum within the float rounding of the other rows of the solver."""
    scene = perturbed(0.03)

    def momenta() -> np.ndarray:
        momentum = scene.mass[:, None] * scene.data.qvel[scene.dofs]
        spin = np.cross(scene.positions(), momentum) / RADIUS
        return np.array([momentum.sum(axis=0), spin.sum(axis=0)])

    before = momenta()
    scene.step(60)
    assert abs(writhe(scene.positions())) > 0.1
    scale = float((scene.mass[:, None] * np.abs(scene.data.qvel[scene.dofs])).sum())
    change = np.abs(momenta() - before).max(axis=1) / scale
    assert change[0] < 1e-5
    assert change[1] < 1e-3


def test_a_free_end_unwinds_and_held_ends_do_not():
    scene = FlexScene(rope(straight(12, 0.0125), twist=TWIST), floor=False, gravity=STILL)
    scene.hold(0, 11)
    angle_of(scene)[0] = 5.0
    scene.step(20)
    assert angle_of(scene)[0] == pytest.approx(5.0, abs=0.2)
    scene.release()
    scene.step()
    assert angle_of(scene)[0] == 0.0


def test_a_held_rope_is_stable_at_five_radians():
    """MuJoCo's own cable diverges there."""
    scene = FlexScene(rope(straight(41, 0.0125), bend=BEND, twist=TWIST, radius=2e-3), floor=False)
    scene.hold(0, 1, 39, 40)
    angle_of(scene)[0] = 5.0
    scene.step_each({39: (-0.1, 0.0, 0.0), 40: (-0.1, 0.0, 0.0)}, 200)
    scene.step(200)
    assert np.isfinite(scene.data.qpos).all()
    assert scene.strain_99 < 0.01
    assert np.abs(scene.data.qvel).max() < 2.0
