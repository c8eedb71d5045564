"""Rods with held, driven and sliding ends against closed forms; frames against exact rotations."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softgym_mj.reality.rope.cable import Properties
from softgym_mj.reality.rope.ends import End, Motion, rolls
from softgym_mj.reality.rope.rods import Rod, RodScene
from tests.oracles.rods import greenhill, unit

BEND, TWIST = 8e-3, 5e-3  # [N m^2]
MADE_OF = Properties(
    density=0.3, stretch=300.0, bend=BEND, twist=TWIST, stretch_damping=0.0, bend_damping=0.0,
    air_damping=0.3, radius=0.01,
)  # fmt: skip
STEP, SUBSTEPS = 2e-3, 10
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
CLAMPED = End("clamped")


def straight(*ends: End, elements: int = 20, bow: float = 0.0, **changed) -> Rod:
    """A rod of 1 m along X with a bow [m] along Y."""
    nodes = np.zeros((elements + 1, 3))
    nodes[:, 0] = np.linspace(0.0, 1.0, elements + 1)
    nodes[:, 1] = bow * (1.0 - np.cos(2.0 * np.pi * nodes[:, 0])) / 2.0
    return Rod(nodes, 1.0, Z, dataclasses.replace(MADE_OF, **changed), ends)


def simulated(*rods: Rod, seconds: float, frames: int = 2, step: float = STEP, **settings):
    """All frames of a scene."""
    scene = RodScene(rods, timestep=step, substeps=SUBSTEPS, **settings)
    return list(scene.frames(frames, round(seconds / step / (frames - 1))))


def turning(rotation: np.ndarray, seconds: float) -> Motion:
    """A turn at constant speed by a rotation vector (3,) [rad]."""
    return Motion(np.array([0.0, seconds]), np.zeros((2, 3)), np.stack([0.0 * rotation, rotation]))


# ------------------------------------------------------------------ frames


def test_a_frame_that_circles_a_cone_rolls_by_the_area_it_encloses():
    """Angle between fixed frames and transport, by Gauss and Bonnet."""
    tilt, around = 0.4, np.linspace(0.0, 2.0 * np.pi, 2001)
    turned = Rotation.from_euler("ZYZ", np.stack([around, 0 * around + tilt, -around], axis=1))
    found = rolls(turned.apply(Z), turned.apply(X)).sum()
    assert found == pytest.approx(-2.0 * np.pi * (1.0 - np.cos(tilt)), rel=1e-4)


def test_a_spin_is_a_roll_and_a_tilt_is_none():
    turn = np.linspace(0.0, 1.0, 5)[:, None]
    spun, tilted = (Rotation.from_rotvec(turn * axis) for axis in (X, np.array([0.0, 0.6, 0.8])))
    np.testing.assert_allclose(rolls(spun.apply(X), spun.apply(Z)), 0.25)
    np.testing.assert_allclose(rolls(tilted.apply(X), tilted.apply(Z)), 0.0, atol=1e-15)


def test_a_turned_end_twists_a_rod_evenly_and_a_free_one_not():
    turn = turning(1.5 * X, 0.2)
    between, free = straight(CLAMPED, End("clamped", turn)), straight(End("clamped", turn), End())
    last = simulated(between, dataclasses.replace(free, nodes=free.nodes + Z), seconds=0.2)[-1]
    middles = (np.arange(20) + 0.5) / 20
    (_, directors), (_, carried) = last
    angles = np.arctan2(-directors[:, 1], directors[:, 2])
    np.testing.assert_allclose(angles, 1.5 * middles, atol=5e-3)
    np.testing.assert_allclose(np.arctan2(-carried[:, 1], carried[:, 2]), 1.5, atol=1e-6)


def test_clamps_that_turn_together_carry_the_rod_without_twist():
    """Both ends turn about Y through the middle, each at its own place."""
    times = np.linspace(0.0, 2.0, 81)
    angles = 0.6 * (1.0 - np.cos(np.pi * times / 2.0))
    turned = Rotation.from_rotvec(angles[:, None] * np.array([0.0, 1.0, 0.0]))
    ends = []
    for place in (-0.5 * X, 0.5 * X):
        ends.append(End("clamped", Motion(times, turned.apply(place) - place, turned.as_rotvec())))
    rod = straight(*ends, density=0.01, air_damping=0.1)
    ((nodes, directors),) = simulated(rod, seconds=2.5)[-1]
    expected = turned[-1].apply(rod.nodes - 0.5 * X) + 0.5 * X
    np.testing.assert_allclose(nodes, expected, atol=1e-3)
    np.testing.assert_allclose(directors, np.tile(turned[-1].apply(Z), (20, 1)), atol=5e-3)


# ------------------------------------------------------------------ mechanics


def test_a_cantilever_bends_as_a_beam_from_its_end():
    """Not from the middle of its first element: that is 7 % less."""
    end = End(force=np.array([0.0, 0.0, -1e-3]))
    light = {"density": 0.03, "air_damping": 0.1}
    other = straight(end, CLAMPED, **light)
    other = dataclasses.replace(other, nodes=other.nodes + np.array([0.0, 1.0, 0.0]))
    (first, _), (second, _) = simulated(straight(CLAMPED, end, **light), other, seconds=5.0)[-1]
    deflection = 1e-3 / (3.0 * BEND)
    assert -first[-1, 2] == pytest.approx(deflection, rel=0.01)
    assert -second[0, 2] == pytest.approx(deflection, rel=0.01)


def test_a_sliding_end_has_the_tension_of_its_load():
    load, damping = 0.5, 6.0
    sliding = End("clamped", slide=-X, force=np.array([load, 0.3, 0.0]))
    ((nodes, _),) = simulated(straight(CLAMPED, sliding, air_damping=damping), seconds=1.5)[-1]
    strain = 20.0 * np.diff(nodes[:, 0]) - 1.0
    np.testing.assert_allclose(300.0 * strain[1:], load, rtol=0.01)
    assert np.abs(nodes[:, 1:]).max() < 1e-9


def test_rods_with_a_sliding_end_buckle_at_the_twist_of_greenhill():
    tension, ramp, hold, shares = 10.0, 2.0, 3.0, (0.97, 1.03)
    critical = greenhill(tension) * BEND / TWIST
    rods = []
    for i, share in enumerate(shares):
        times = np.linspace(0.0, ramp, 41)
        turn = share * critical * (0.5 - 0.5 * np.cos(np.pi * times / ramp))
        motion = Motion(times, np.zeros((41, 3)), np.outer(turn, X))
        end = End("clamped", motion, X, tension * BEND * X)
        rod = straight(CLAMPED, end, bow=1e-4)
        rods.append(dataclasses.replace(rod, nodes=rod.nodes + i * np.array([0.0, 0.3, 0.0])))
    frames = simulated(*rods, seconds=ramp + hold, frames=11, step=1.5625e-3)
    for i, grows in enumerate((False, True)):
        off = [np.abs(frame[i][0][:, 1:] - [0.3 * i, 0.0]).max() for frame in frames]
        assert (off[10] > 2.0 * off[7]) == grows
        assert off[10] < 0.1
        angle = frames[-1][i][1]
        assert np.abs(unit(angle) - angle).max() < 1e-12


def test_rods_touch_each_other_and_obstacles():
    stiff = straight(End("pinned"), End("pinned"), air_damping=3.0)
    soft = straight(End("pinned"), End("pinned"), air_damping=3.0, stretch=20.0)
    across = soft.nodes[:, [1, 0, 2]] + np.array([0.525, -0.475, 0.03])
    soft = dataclasses.replace(soft, nodes=across, director=X)
    free = straight(End(), End(), air_damping=3.0)
    free = dataclasses.replace(free, nodes=free.nodes + np.array([0.0, 1.0, -0.25]))
    floor = {"type": "plane", "pos": [0.0, 0.0, -0.3], "size": [0.0, 0.0, 1.0]}
    rods = stiff, soft, free
    last = simulated(*rods, seconds=2.0, obstacles=[floor], gravity=(0.0, 0.0, -9.81))[-1]
    (below, _), (above, _), (lying, _) = last
    # They cross in the middle of an element of both; 2 N compress the contact by 1 mm.
    gap = above[9:11, 2].mean() - below[10:12, 2].mean()
    assert gap == pytest.approx(0.019, rel=0.02)
    np.testing.assert_allclose(lying[:, 2], -0.3 + 0.01, atol=2e-4)
