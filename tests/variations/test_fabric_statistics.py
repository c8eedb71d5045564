"""The domain "fabrics": its distribution against published tables, and tasks that have it."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.variations import fabric_statistics
from softgym_mj.variations.indices import generator

# 618 fabrics: densities [g/m^2] of a band, number in it, bending stiffness [uN m] at 10, 50, 90 %.
TABLE = [
    (15, 60, 63, 0.7, 1.3, 7.3), (60, 100, 84, 1.6, 4.1, 14), (100, 150, 90, 2.7, 7.7, 13),
    (150, 200, 84, 4.0, 17, 36), (200, 300, 155, 5.4, 18, 42), (300, 400, 71, 10, 34, 78),
    (400, 870, 71, 19, 51, 116),
]  # fmt: skip
CLOTH = [name for name, record in softgym_mj.TASKS.items() if "cloth" in record.tags]
# Variations with the lightest, the heaviest and the limpest fabric of the first fifty held out.
DRAWN = {i: fabric_statistics.draw(generator("domain/fabrics", i)) for i in range(800, 850)}
EXTREMES = {
    min(DRAWN, key=lambda i: DRAWN[i]["density"]),
    max(DRAWN, key=lambda i: DRAWN[i]["density"]),
    min(DRAWN, key=lambda i: DRAWN[i]["bend_bias"] / DRAWN[i]["density"]),
}


@pytest.fixture(scope="module")
def fabrics() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    drawn = [fabric_statistics.draw(random) for _ in range(20_000)]
    return {name: np.array([fabric[name] for fabric in drawn]) for name in drawn[0]}


@pytest.mark.parametrize("row", TABLE, ids=[f"{row[0]}-{row[1]}" for row in TABLE])
def test_densities_and_stiffness_go_together_as_in_the_table(fabrics, row):
    low, high, count, tenth, half, most = row
    density = 1e3 * fabrics["density"]
    inside = (density >= low) & (density < high)
    assert inside.mean() == pytest.approx(count / 618, abs=0.01)  # Four standard deviations.
    bending = 1e6 * np.sqrt(fabrics["bend_stiffness"] * fabrics["bend_weft"])[inside]
    assert bending.min() == pytest.approx(tenth, rel=0.02)
    assert bending.max() == pytest.approx(most, rel=0.02)
    assert np.median(bending) == pytest.approx(half, rel=0.08)
    np.testing.assert_allclose(bending, 1e6 * fabrics["bend_bias"][inside], rtol=1e-9)


def test_stiffness_grows_with_density_as_was_found(fabrics):
    """Published fit to the whole table: ln B = 1.19 ln density + const."""
    slope, _ = np.polyfit(np.log(fabrics["density"]), np.log(fabrics["bend_bias"]), 1)
    assert slope == pytest.approx(1.19, abs=0.12)


def test_warp_and_weft_differ_as_was_found(fabrics):
    ratio = fabrics["bend_stiffness"] / fabrics["bend_weft"]
    assert (ratio.min(), ratio.max()) == pytest.approx((0.4, 4.6), rel=0.01)
    assert np.median(ratio) == pytest.approx(1.5, rel=0.05)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("drag", 0.8, 2.0), ("friction", 0.2, 1.0), ("layer_friction", 0.2, 1.0)],
)
def test_air_and_friction_are_drawn_evenly(fabrics, name, low, high):
    values = fabrics[name]
    assert values.min() >= low and values.max() <= high
    assert values.mean() == pytest.approx((low + high) / 2, abs=0.01 * (high - low))
    assert values.std() == pytest.approx((high - low) / np.sqrt(12), rel=0.02)


def test_all_are_within_what_is_said_of_them(fabrics):
    for name, (low, high) in fabric_statistics.RANGES.items():
        assert low * (1 - 1e-9) <= fabrics[name].min() <= fabrics[name].max() <= high * (1 + 1e-9)


@pytest.mark.parametrize(
    "task", [pytest.param(t, marks=[] if t == CLOTH[0] else pytest.mark.long) for t in CLOTH]
)
def test_tasks_have_the_fabric_of_the_variation(task):
    env = softgym_mj.load(task, split="evaluate", domain="fabrics")
    random = np.random.default_rng(0)
    for variation in EXTREMES:
        env.reset(variation)
        fabric = DRAWN[variation]
        info = env.info()
        for name, value in fabric.items():
            assert info[f"domain_{name}"] == value
        model = env.physics.model.ptr
        mass = model.body_mass[model.flex_vertbodyid].sum()
        edges = model.flexedge_length0[model.flex_elemedge].reshape(-1, 3)
        half = edges.sum(axis=1) / 2  # Heron's formula.
        area = np.sqrt(half * np.prod(half[:, None] - edges, axis=1)).sum()
        assert mass == pytest.approx(fabric["density"] * area, rel=1e-6)
        for _ in range(5):
            timestep = env.step(random.uniform(-1, 1, env.action_spec().shape))
            assert all(np.isfinite(value).all() for value in timestep.observation.values())
        assert env.info()["physics_warnings"] == 0


def test_the_physics_of_fabrics_goes_with_other_pictures_and_with_numbers():
    settings = {"physics": "fabrics", "visual": "in_distribution", "friction": 0.7}
    env = softgym_mj.load("spread_cloth", split="evaluate", domain=settings)
    env.reset(803)
    info = env.info()
    assert info["domain_density"] == DRAWN[803]["density"]
    assert env.task.domain.values["friction"] == 0.7
    assert env.task.domain.values["thickness"] == 0.01
    assert info["domain_hue"] != 0.0


@pytest.mark.parametrize("task", ["straighten_rope", "pour_water"])
def test_there_are_no_fabrics_without_cloth(task):
    with pytest.raises(InvalidArgumentError, match=r"domain='fabrics'.*a task with cloth"):
        softgym_mj.load(task, domain="fabrics")


def test_fabrics_are_no_preset_of_one_number():
    with pytest.raises(InvalidArgumentError, match=r"density='fabrics' is unknown"):
        softgym_mj.load("spread_cloth", domain={"density": "fabrics"})
    with pytest.raises(InvalidArgumentError, match=r"visual='fabrics' is unknown"):
        softgym_mj.load("spread_cloth", domain={"visual": "fabrics"})
