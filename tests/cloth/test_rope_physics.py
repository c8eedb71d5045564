"""Rope against closed forms: springs and beams; and against itself."""

import numpy as np
import pytest

from softgym_mj.cloth import solver
from softgym_mj.entities.rope import BEND_STIFFNESS, LENGTH, MASS
from tests.cloth.beams import chain_drop, elastica_drop
from tests.cloth.flex_scene import GRAVITY, FlexScene, rope, straight

DENSITY = MASS / LENGTH  # [kg/m]
PIECE, RADIUS = 0.0125, 0.00625  # [m]
STRETCH_STIFFNESS = 500.0  # [N]


# ------------------------------------------------------------------ statics


@pytest.mark.parametrize("pieces", [3, 4, 6])
def test_the_end_of_the_default_rope_hangs_like_a_beam(pieces):
    """Clamped with so many pieces free. Half a piece of what is clamped bends, too."""
    clamped = rope(straight(pieces + 2, PIECE, (0.0, 0.0, 1.0)), bend_damping=0.05)
    drop = hang(clamped)
    weight = DENSITY * GRAVITY
    chain = chain_drop(pieces, PIECE, weight, BEND_STIFFNESS)
    beam = elastica_drop((pieces + 0.5) * PIECE, weight, BEND_STIFFNESS)
    assert chain == pytest.approx(beam, rel=0.05)
    assert drop == pytest.approx(chain, rel=0.06)
    assert drop == pytest.approx(beam, rel=0.1)


@pytest.mark.parametrize("load", [2.0, 8.0])
def test_a_stiff_rope_hangs_like_an_elastica(load):
    piece, pieces = 0.05, 6
    weight, length = DENSITY * GRAVITY, piece * pieces
    stiffness = weight * length**3 / load
    points = straight(pieces + 2, piece, (0.0, 0.0, 1.0))
    drop = hang(rope(points, bend=stiffness, radius=0.01, bend_damping=0.05, stretch=5000))
    expected = elastica_drop(length + piece / 2, weight, stiffness)
    assert drop == pytest.approx(expected, rel=0.1)


def hang(clamped) -> float:
    """By how much [m] the end hangs lower than the first two vertices, mean of 2 s."""
    scene = FlexScene(clamped, floor=False)
    scene.hold(0, 1)
    scene.step(400)
    heights = []
    for _ in range(200):
        scene.step()
        heights.append(scene.positions()[-1, 2])
    return scene.held[1][2] - float(np.mean(heights))


def test_a_hanging_rope_stretches_by_the_weight_below():
    scene = FlexScene(rope(straight(41, PIECE)), floor=False)
    x = scene.positions()
    scene.place(np.column_stack([0 * x[:, 0], 0 * x[:, 0], 2.0 - x[:, 0]]))
    scene.hold(0)
    scene.step(300)
    below = scene.mass.sum() - np.cumsum(scene.mass)[:-1]
    np.testing.assert_allclose(scene.strain(), below * GRAVITY / STRETCH_STIFFNESS, rtol=0.02)
    force = solver.holding_force(scene.model, scene.data, 0)
    assert force == pytest.approx(below[0] * GRAVITY, rel=0.01)


@pytest.mark.parametrize("weight", [1.0, 20.0])
def test_a_weight_stretches_a_rope_by_force_over_stiffness(weight):
    """Weights are in newtons."""
    scene = FlexScene(rope(straight(41, PIECE)), floor=False, gravity=(0, 0, 0))
    scene.hold(0)
    scene.data.qfrc_applied[scene.dofs[-1, 0]] = weight
    scene.step(300)
    np.testing.assert_allclose(scene.strain(), weight / STRETCH_STIFFNESS, rtol=0.02)


# ------------------------------------------------------------------ motion


@pytest.mark.parametrize(("speed", "limit"), [(0.3, 0.01), (1.0, 0.02), (1.73, 0.03)])
@pytest.mark.parametrize("vertex", [40, 20])
def test_a_dragged_rope_hardly_stretches(speed, limit, vertex):
    """Sideways, then along."""
    scene = FlexScene(rope(straight(41, PIECE, (0.0, 0.0, RADIUS))))
    scene.hold(vertex)
    strains = []
    for velocity in ((0.0, speed, 0.0), (speed, 0.0, 0.0)):
        for _ in range(round(0.4 / speed / 0.01)):
            scene.step(1, velocity)
            strains.append(scene.strain().max())
    assert max(strains) < limit
    assert scene.lowest > RADIUS - 1e-4


def test_a_rope_in_free_flight_gains_no_energy_and_keeps_its_momentum():
    scene = FlexScene(rope(straight(41, PIECE)), floor=False, gravity=(0, 0, 0))
    velocities = np.random.default_rng(0).normal(0, 1.0, (41, 3))
    scene.place(scene.positions(), velocities)
    energies = []
    for _ in range(100):
        stretch = scene.strain() * scene.lengths
        kinetic = 0.5 * (scene.mass[:, None] * scene.velocities() ** 2).sum()
        bend = np.diff(scene.positions(), n=2, axis=0)
        energies.append(
            kinetic
            + 0.5 * STRETCH_STIFFNESS / PIECE * (stretch**2).sum()
            + 0.5 * BEND_STIFFNESS / PIECE**3 * (bend**2).sum()
        )
        scene.step()
    assert np.diff(energies).max() < 0.015 * energies[0]
    change = (scene.mass[:, None] * (scene.velocities() - velocities)).sum(axis=0)
    assert np.abs(change).max() < 1e-5 * np.abs(scene.mass[:, None] * velocities).sum()


# ------------------------------------------------------------------ strands


def least_distance(points: np.ndarray, apart: int = 4) -> float:
    """Smallest distance [m] of midpoints of pieces that are `apart` pieces or more apart."""
    shares = np.linspace(0.0, 1.0, 6)[None, :, None]
    on_pieces = points[:-1, None] * (1 - shares) + points[1:, None] * shares
    count = len(on_pieces)
    flat = on_pieces.reshape(-1, 3)
    distances = np.linalg.norm(flat[:, None] - flat, axis=2).reshape(count, 6, count, 6)
    first, second = np.indices((count, count))
    return float(distances.min(axis=(1, 3))[second - first >= apart].min())


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 10))]
)
def test_coils_laid_on_each_other_never_cross(seed):
    random = np.random.default_rng(seed)
    scene = FlexScene(rope(straight(81, PIECE, (-0.5, 0.0, RADIUS))))
    scene.hold(80)
    distances, strains = [], []

    def lead(goal):
        while (left := np.linalg.norm(goal - scene.held[80])) > 1e-6:
            scene.step(1, (goal - scene.held[80]) / left * min(0.6, left / 0.01))
            strains.append(scene.strain().max())
            if scene.count % 8 == 0:
                distances.append(least_distance(scene.positions()))

    lead(np.array([0.3, 0.0, 0.25]))
    angle = random.uniform(0.0, 2 * np.pi)
    for turn in range(60):
        angle += 0.3 + 0.2 * random.random()
        height = 0.25 - 0.2 * turn / 60
        lead(np.array([0.06 * np.cos(angle), 0.06 * np.sin(angle), height]))
    scene.release()
    scene.step(200)
    distances.append(least_distance(scene.positions()))
    assert min(distances) > 0.8 * 2 * RADIUS
    assert max(strains) < 0.02
    assert scene.lowest > RADIUS - 0.001
