"""Shirts drawn from a cut: measures, seams and openings, key points, shares of the area."""

import math

import numpy as np
import pytest

from softgym_mj.entities.shirt import KEYS, Cut, Shirt, num_vertices
from softgym_mj.exceptions import InvalidArgumentError

LONG = Cut(sleeve=0.4, sleeve_angle=0.75, cuff=0.09)


@pytest.fixture(scope="module", params=[Cut(), LONG], ids=["short", "long"])
def shirt(request):
    return Shirt(request.param)


def edges_and_rims(shirt):
    """Vertices of all edges (n, 2), and those around each opening."""
    sides = np.sort(shirt.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    assert set(counts) == {1, 2}  # A surface.
    groups = []
    for a, b in edges[counts == 1].tolist():
        touched = [group for group in groups if {a, b} & group]
        groups = [group for group in groups if group not in touched] + [{a, b}.union(*touched)]
    return edges, groups


def test_it_has_the_measures_of_its_cut(shirt):
    cut, at = shirt.cut, dict(zip(KEYS, shirt.laid()[shirt.keys], strict=True))

    def apart(first, second):
        return np.linalg.norm((at[first] - at[second])[:2])

    assert apart("left armpit", "right armpit") == pytest.approx(2 * cut.chest)
    assert apart("left hem", "right hem") == pytest.approx(2 * cut.flare * cut.chest)
    for side in ("left", "right"):
        ends = f"{side} cuff, inner end", f"{side} cuff, outer end"
        assert apart(*ends) == pytest.approx(cut.cuff)
        assert apart(f"{side} armpit", f"{side} shoulder") == pytest.approx(cut.armhole)
        cuff = (at[ends[0]] + at[ends[1]]) / 2
        sleeve = cuff - (at[f"{side} armpit"] + at[f"{side} shoulder"]) / 2
        assert np.hypot(*sleeve[:2]) == pytest.approx(cut.sleeve)
        assert math.atan2(-sleeve[1], abs(sleeve[0])) == pytest.approx(cut.sleeve_angle)
    height = at["collar"][1] - at["left hem"][1]
    assert height == pytest.approx(cut.length - cut.neck_front)


def test_it_is_one_surface_with_openings_at_hem_neck_and_cuffs(shirt):
    edges, groups = edges_and_rims(shirt)
    keys = dict(zip(KEYS, shirt.keys.tolist(), strict=True))
    assert len(groups) == 4
    for group in (("left hem", "right hem"), ("collar",), ("left cuff, inner end",)):
        (found,) = [own for own in groups if keys[group[0]] in own]
        assert all(keys[name] in found for name in group)
    # Euler's characteristic of a sphere with four holes: 2 - 4.
    assert shirt.num_points - len(edges) + len(shirt.triangles) == -2


def test_its_right_is_the_mirror_image_of_its_left(shirt):
    points = shirt.laid()
    mirrored = points * [-1.0, 1.0, 1.0]
    away = np.linalg.norm(points[:, None] - mirrored, axis=2)
    partner = away.argmin(axis=1)
    assert away.min(axis=1).max() < 1e-9
    np.testing.assert_array_equal(partner[shirt.keys], shirt.keys[::-1])
    triangles = {tuple(sorted(triangle)) for triangle in shirt.triangles.tolist()}
    assert {tuple(sorted(partner[list(each)].tolist())) for each in triangles} == triangles


def test_shares_add_up_and_triangles_face_outwards(shirt):
    arrays, points = shirt.arrays, shirt.laid()
    assert arrays["body"].sum() + arrays["sleeves"].sum() == pytest.approx(1.0)
    left = (arrays["sleeves"] * arrays["is_left"]).sum()
    assert left == pytest.approx(arrays["sleeves"].sum() / 2)
    a, b, c = (points[shirt.triangles[:, k]] for k in range(3))
    up = np.cross(b - a, c - a)[:, 2]
    height = (a + b + c)[:, 2] / 3 - points[:, 2].mean()
    assert (np.sign(up) == np.sign(height)).all()
    # Two layers of sleeves are trapezoids, sheared at the body.
    cut = shirt.cut
    sleeve = cut.sleeve * (cut.armhole * math.cos(cut.sleeve_angle) + cut.cuff) / 2
    is_sleeve = (arrays["body"][shirt.triangles] == 0.0).any(axis=1)
    assert abs(up[is_sleeve]).sum() / 2 == pytest.approx(4 * sleeve, rel=0.02)
    assert arrays["sleeves"].sum() == pytest.approx(4 * sleeve / shirt.area, rel=0.02)


def test_resolutions_and_sizes():
    counts = [num_vertices(Cut(), fidelity) for fidelity in ("fast", "default", "accurate")]
    assert counts == sorted(counts)
    assert num_vertices(Cut(), "default") == Shirt().num_points < num_vertices(LONG, "default")
    shirt = Shirt()
    assert not shirt.resize(Cut()) and shirt.resize(LONG)
    assert shirt.num_points == num_vertices(LONG, "default")
    with pytest.raises(InvalidArgumentError, match="fidelity"):
        Shirt(fidelity="best")
