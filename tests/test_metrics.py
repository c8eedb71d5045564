"""Metrics against closed forms, the published table, shapely and exact arithmetic."""

import numpy as np
import pytest
import shapely
import torch

from softgym_mj import metrics
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.exceptions import InvalidArgumentError

RHO = 0.00625  # FleX particle spacing [m].
SQUARE_CELLS = 100  # SoftGym's covered-area grid has 100 x 100 cells.

# Cloths of docs/softgym.md 3.6. (n, m): upper bound, flat aligned area, its ratio, ratios when
# rotated by 15, 30 and 45 degrees, ratio of the half-fold. Ratios are relative to the upper bound,
# n m rho^2.
TABLE = {
    (60, 60): (0.140625, 0.135977, 0.9669, (1.0368, 1.0400, 1.0428), 0.4753),
    (96, 58): (0.217500, 0.211523, 0.9725, (1.0309, 1.0344, 1.0361), 0.4811),
    (90, 90): (0.316406, 0.309414, 0.9779, (1.0250, 1.0285, 1.0358), 0.4835),
    (119, 119): (0.553164, 0.543906, 0.9833, (1.0194, 1.0209, 1.0194), 0.4833),
    (60, 119): (0.278906, 0.271953, 0.9751, (1.0296, 1.0303, 1.0281), 0.4793),
}
ANGLES = (15.0, 30.0, 45.0)  # [deg] of the table.
HALF_ULP = 0.5e-6 + 1e-12  # Rounding of the table's areas [m^2].

each_size = pytest.mark.parametrize("size", TABLE, ids="{0[0]}x{0[1]}".format)


def make_grid(n: int, m: int, step_x: float, step_y: float) -> np.ndarray:
    """Vertices (n m, 3) of a flat grid, rows along X."""
    x, y = np.meshgrid(np.arange(n) * step_x, np.arange(m) * step_y)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * m)])


def make_triangles(n: int, m: int) -> np.ndarray:
    """Two triangles a cell of an n x m grid."""
    index = np.arange(n * m).reshape(m, n)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])


def make_edges(triangles: np.ndarray) -> np.ndarray:
    """The distinct edges of a mesh."""
    pairs = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def stacked(*meshes: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes as one."""
    vertices, triangles, number = [], [], 0
    for points, faces in meshes:
        vertices.append(points)
        triangles.append(faces + number)
        number += len(points)
    return np.concatenate(vertices), np.concatenate(triangles)


def flat(size: tuple[int, int]) -> np.ndarray:
    return make_grid(*size, RHO, RHO)


def half_fold(size: tuple[int, int]) -> np.ndarray:
    """The second half of the columns on the first, as in the table: n // 2 columns stay apart."""
    n, m = size
    column = np.arange(n)
    folded = np.minimum(np.minimum(column, n - 1 - column), n // 2 - 1)
    vertices = flat(size)
    vertices[:, 0] = np.tile(folded, m) * RHO
    return vertices


def rotated(vertices: np.ndarray, degrees: float) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return vertices @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def softgym_area(vertices: np.ndarray) -> float:
    """SoftGym's own covered area, written down from docs/softgym.md 3.6: the slow reference."""
    points = vertices[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    cell = (high - low) / SQUARE_CELLS
    marked = np.zeros((SQUARE_CELLS, SQUARE_CELLS), bool)
    first = np.maximum(0, np.round((points - low - RHO) / cell)).astype(int)
    last = np.minimum(SQUARE_CELLS, np.round((points - low + RHO) / cell)).astype(int)
    last = np.maximum(last, first + 1)
    for (left, bottom), (right, top) in zip(first.tolist(), last.tolist(), strict=True):
        marked[left:right, bottom:top] = True
    return float(marked.sum() * cell.prod())


def softgym_upper_bound(size: tuple[int, int]) -> float:
    n, m = size
    return softgym_area(make_grid(n, m, RHO * n / (n - 1), RHO * m / (m - 1)))


def union_area(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Area of the union of the projected triangles by shapely."""
    corners = vertices[triangles, :2]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    polygons = [shapely.Polygon(corner) for corner in corners[np.abs(doubled) > 1e-14]]
    return float(shapely.union_all(polygons).area)


# ---------------------------------------------------------------- the reference itself


@each_size
def test_reference_reproduces_the_whole_table(size):
    upper, aligned, aligned_ratio, rotated_ratios, fold_ratio = TABLE[size]
    bound = softgym_upper_bound(size)
    assert bound == pytest.approx(upper, abs=HALF_ULP)
    assert bound == pytest.approx(size[0] * size[1] * RHO**2, rel=1e-12)
    assert softgym_area(flat(size)) == pytest.approx(aligned, abs=HALF_ULP)
    assert softgym_area(flat(size)) / bound == pytest.approx(aligned_ratio, abs=0.51e-4)
    for angle, ratio in zip(ANGLES, rotated_ratios, strict=True):
        assert softgym_area(rotated(flat(size), angle)) / bound == pytest.approx(ratio, abs=0.51e-4)
    assert softgym_area(half_fold(size)) / bound == pytest.approx(fold_ratio, abs=0.51e-4)


# ---------------------------------------------------------------- covered_area


@each_size
@pytest.mark.parametrize("angle", (0.0, *ANGLES))
def test_flat_area_is_the_published_one_and_differs_from_softgyms_by_its_border(size, angle):
    n, m = size
    vertices = rotated(flat(size), angle)
    width, depth = (n - 1) * RHO, (m - 1) * RHO
    ours = metrics.covered_area(vertices, make_triangles(n, m))
    assert ours == pytest.approx(width * depth, rel=1e-3 if angle else 1e-12)
    assert ours == pytest.approx(TABLE[size][1], rel=1e-3 if angle else 1e-12, abs=1e-6)
    # Each of SoftGym's particles covers a square of 2 rho along the axes: the sheet grows by at
    # most the support of that square along its sides, and by half a cell of rounding.
    radians = np.radians(angle)
    support = RHO * (np.cos(radians) + np.sin(radians)) + np.ptp(vertices[:, :2]) / SQUARE_CELLS
    theirs = softgym_area(vertices)
    assert ours - 1e-4 * ours <= theirs <= (width + 2 * support) * (depth + 2 * support)
    # Both stay within 5 % of the bound n m rho^2 that lies between them.
    bound = n * m * RHO**2
    assert ours == pytest.approx(bound, rel=0.05)
    assert theirs == pytest.approx(bound, rel=0.05)


def crumpled(seed: int, noise: float, folds: int, n: int = 12, m: int = 14) -> np.ndarray:
    """A 0.33 x 0.39 m sheet mirrored at random lines, then shaken by `noise` [m]."""
    random = np.random.default_rng(seed)
    vertices = make_grid(n, m, 0.03, 0.03)
    vertices[:, :2] -= vertices[:, :2].mean(axis=0)
    for _ in range(folds):
        angle, shift = random.uniform(0.0, 2 * np.pi), random.uniform(-0.08, 0.08)
        normal = np.array([np.cos(angle), np.sin(angle)])
        beyond = np.maximum(vertices[:, :2] @ normal - shift, 0.0)
        vertices[:, :2] -= 2 * beyond[:, None] * normal
        vertices[:, 2] += 0.01 * (beyond > 0)
    return vertices + random.normal(0.0, noise, vertices.shape)


CRUMPLED = [
    (seed, noise, folds) for seed in range(4) for noise in (0.002, 0.02) for folds in (1, 3)
]
# Verified by number of lines: 0.1 % with the default one (the worst found is 0.03 %).
TOLERANCES = {64: 1e-2, metrics.AREA_LINES: 1e-3, 1024: 2e-4, 4096: 5e-5}


@pytest.mark.parametrize(("seed", "noise", "folds"), CRUMPLED)
def test_crumpled_area_is_that_of_the_polygon_union(seed, noise, folds):
    vertices, triangles = crumpled(seed, noise, folds), make_triangles(12, 14)
    oracle = union_area(vertices, triangles)
    for lines, tolerance in TOLERANCES.items():
        area = metrics.covered_area(vertices, triangles, lines)
        assert area == pytest.approx(oracle, rel=tolerance)
    # The reading direction is arbitrary: X and Y may be swapped.
    swapped = metrics.covered_area(vertices[:, [1, 0, 2]], triangles)
    assert swapped == pytest.approx(oracle, rel=TOLERANCES[metrics.AREA_LINES])


def test_random_triangle_soup_is_the_polygon_union():
    random = np.random.default_rng(7)
    vertices = random.uniform(-0.3, 0.3, (90, 3))
    triangles = random.permutation(90).reshape(30, 3)
    assert metrics.covered_area(vertices, triangles, lines=4096) == pytest.approx(
        union_area(vertices, triangles), rel=2e-4
    )


@pytest.mark.parametrize("direction", ([1, 0, 0], [0, 1, 0], [0, 0, 1], [3, 4, 1], [-1, 7, 0]))
def test_area_of_a_line_is_zero(direction):
    random = np.random.default_rng(0)
    vertices = random.uniform(-1, 1, (30, 1)) * np.array(direction, float)
    triangles = random.permutation(30).reshape(10, 3)
    assert metrics.covered_area(vertices, triangles) == pytest.approx(0.0, abs=1e-9)
    upright = make_grid(8, 9, 0.03, 0.03)[:, [0, 2, 1]]
    assert metrics.covered_area(upright, make_triangles(8, 9)) == 0.0


# ---------------------------------------------------------------- normalize


@pytest.mark.parametrize(
    ("performance", "lower", "upper", "expected"),
    [
        (-0.25, -0.5, 0.0, 0.5),  # StraightenRope (docs/softgym.md 3.4), end distance 0.25 m.
        (-0.0375, -0.5, 0.0, 0.925),  # The same, end distance 0.5375 m: relaxed.
        (-0.6, -1.2, 0.0, 0.5),
        (2.0, 0.0, 1.0, 2.0),  # Not clipped above ...
        (-1.0, 0.0, 1.0, -1.0),  # ... nor below.
        (0.3, 1.0, 0.0, 0.7),  # A decreasing scale.
        (0.3, 0.3, 0.3, 0.0),  # Equal bounds.
        (0.9, 0.3, 0.3, 0.0),
    ],
)
def test_normalize(performance, lower, upper, expected):
    assert metrics.normalize(performance, lower, upper) == pytest.approx(expected, abs=1e-12)


# ---------------------------------------------------------------- count_intersections


def count(vertices: np.ndarray, triangles: np.ndarray) -> int:
    return count_intersections(vertices, make_edges(triangles), triangles)


def test_flat_and_folded_sheets_do_not_cross():
    triangles = make_triangles(13, 11)
    vertices = make_grid(13, 11, 0.03, 0.03)
    assert count(vertices, triangles) == 0
    folded = vertices.copy()
    beyond = folded[:, 0] > 0.18
    folded[beyond, 0] = 0.36 - folded[beyond, 0]
    folded[beyond, 2] = 0.01
    assert count(folded, triangles) == 0


def test_sheet_pushed_through_another():
    # A horizontal sheet z = 0 over [0, 0.45]^2, and a vertical one in the plane x = 0.2 whose
    # vertices lie at y = 0.101, 0.131, ... and z = -0.075, -0.045, ... Both have 3 cm cells.
    flat_sheet = make_grid(16, 16, 0.03, 0.03)
    upright = make_grid(8, 6, 0.03, 0.03)[:, [2, 0, 1]] + np.array([0.2, 0.101, -0.075])
    vertices, triangles = stacked(
        (flat_sheet, make_triangles(16, 16)), (upright, make_triangles(8, 6))
    )
    # The plane z = 0 lies in one row of the upright cells: it meets 8 vertical edges and the 7
    # diagonals, all inside the flat sheet. The plane x = 0.2 lies in one column of the flat cells,
    # 0.18..0.21; its edges along X are met at y = 0.03 k, its diagonals, which fall from
    # (0.21, 0.03 k) to (0.18, 0.03 (k + 1)), at y = 0.03 k + 0.01. Those in 0.101 < y < 0.311 are
    # k = 4..10 and k = 4..10 (0.13 to 0.31).
    assert count(vertices, triangles) == 8 + 7 + 7 + 7


def whole(value: float) -> int:
    """A number times 2^128, exactly."""
    numerator, denominator = value.as_integer_ratio()
    assert 2**128 % denominator == 0
    return numerator * (2**128 // denominator)


def volume_sign(a, b, c, d) -> int:
    """Sign of the volume of the tetrahedron a b c d, exact: coordinates are whole numbers."""
    ab, ac, ad = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c, d))
    volume = (
        ab[0] * (ac[1] * ad[2] - ac[2] * ad[1])
        - ab[1] * (ac[0] * ad[2] - ac[2] * ad[0])
        + ab[2] * (ac[0] * ad[1] - ac[1] * ad[0])
    )
    return (volume > 0) - (volume < 0)


def slow_count(vertices: np.ndarray, edges: np.ndarray, triangles: np.ndarray) -> int:
    """Every edge against every triangle by signs of exact volumes, no bounding boxes."""
    points = [[whole(value) for value in vertex] for vertex in vertices.tolist()]
    number = 0
    for p, q in edges.tolist():
        for a, b, c in triangles.tolist():
            if {p, q} & {a, b, c}:
                continue
            start, end, corners = points[p], points[q], [points[a], points[b], points[c]]
            if volume_sign(*corners, start) * volume_sign(*corners, end) >= 0:
                continue
            sides = {volume_sign(start, end, corners[i], corners[(i + 1) % 3]) for i in range(3)}
            number += sides in ({1}, {-1})
    return number


def soup(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """20 random triangles of 24 vertices."""
    random = np.random.default_rng(seed)
    vertices = random.uniform(0.0, 1.0, (24, 3))
    return vertices, np.stack([random.choice(24, 3, replace=False) for _ in range(20)])


@pytest.mark.parametrize(
    ("vertices", "triangles", "least"),
    [
        (*soup(0), 20),
        (*soup(1), 20),
        (crumpled(seed=3, noise=0.02, folds=2, n=7, m=6), make_triangles(7, 6), 10),
    ],
    ids=("soup 0", "soup 1", "crumpled"),
)
def test_counts_agree_with_the_slow_loop(vertices, triangles, least):
    edges = make_edges(triangles)
    expected = slow_count(vertices, edges, triangles)
    assert expected > least  # The case is not an empty one.
    assert count_intersections(vertices, edges, triangles) == expected


def test_order_of_edges_and_triangles_does_not_matter():
    # 1,300 edges: several blocks of the vectorized loop.
    vertices, triangles = crumpled(seed=1, noise=0.01, folds=2, n=21, m=22), make_triangles(21, 22)
    edges = make_edges(triangles)
    random = np.random.default_rng(0)
    expected = count_intersections(vertices, edges, triangles)
    assert len(edges) > 1000 and expected > 0
    parts = [
        count_intersections(vertices, edges[i : i + 30], triangles)
        for i in range(0, len(edges), 30)
    ]
    assert sum(parts) == expected
    shuffled = count_intersections(
        vertices, random.permutation(edges)[:, ::-1], random.permutation(triangles)[:, [2, 0, 1]]
    )
    assert shuffled == expected


@pytest.mark.parametrize("number", [3, 150])
def test_tensors_of_any_number_of_pieces(number):
    """More than are kept for a line at a time: apart, and every third one twice."""
    corners = np.array([[0.0, 0.0], [0.6, 0.1], [0.2, 1.0]])
    places = np.random.default_rng(0).permutation(number)
    vertices = (corners + np.stack([places, 0 * places], axis=1)[:, None]).reshape(-1, 2)
    triangles = np.arange(3 * number).reshape(-1, 3)
    triangles = np.concatenate([triangles, triangles[::3]])
    found = metrics.covered_area(
        torch.from_numpy(vertices)[None], torch.from_numpy(triangles)[None]
    )
    expected = metrics.covered_area(vertices, triangles)
    assert found.item() == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(number * 0.29, rel=1e-3)


def test_more_points_than_tensors_are_matched_for():
    points = torch.zeros(1, 65, 3)
    with pytest.raises(InvalidArgumentError, match=r"points=65.*at most 64"):
        metrics.matched_distance(points, points)


def test_a_reward_of_several_terms_has_the_same_bits_in_a_batch():
    terms = {"a": 1e16, "b": 1.0, "c": -1e16}  # Rounded after each addition: 0, not 1.
    batch = {name: np.array([value]) for name, value in terms.items()}
    assert metrics.Measures(0.0, terms).reward == metrics.Measures(0.0, batch).reward[0] == 0.0


@pytest.mark.parametrize("like", [np.zeros(3), np.float64(0.0), torch.zeros(3)])
def test_constants_are_of_the_library_of_an_array_or_a_scalar(like):
    found = metrics.constant([0.5, 2.0], like)
    assert isinstance(found, torch.Tensor if isinstance(like, torch.Tensor) else np.ndarray)
    assert found.tolist() == [0.5, 2.0]
