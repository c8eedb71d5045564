"""Published fabrics: their numbers, against what else is published of them, and in a model."""

import dataclasses

import mujoco
import pytest

from softgym_mj.cloth import fabrics
from softgym_mj.cloth.fabrics import ASSUMED, FABRICS, FITTED, MEASURED
from softgym_mj.entities import Fabric
from softgym_mj.entities.cloth import Cloth
from softgym_mj.exceptions import InvalidArgumentError

# [mm] Gravity bending lengths (B / (density g))^(1/3) as tabulated for each fabric.
GRAVITY_LENGTHS = {
    "gray_interlock": 14.1, "ivory_rib_knit": 14.9, "pink_ribbon": 21.4, "white_dots": 20.2,
    "navy_sparkle": 17.7, "camel_ponte": 14.7, "black_denim": 18.3, "white_swim": 19.2,
    "red_jet_set": 16.2, "royal_target": 24.0, "rgbench_t_shirt": 7.7, "rgbench_hoodie": 10.9,
    "rgbench_coat": 18.1, "rgbench_pleated_skirt": 8.2, "rgbench_sun_jacket": 9.2,
    "rgbench_blazer": 9.6, "rgbench_cake_skirt": 9.1, "rgbench_shirt": 9.7, "flex_nominal": 8.6,
}  # fmt: skip


def test_fabrics_drape_by_the_lengths_that_are_known_of_them():
    assert list(FABRICS) == list(GRAVITY_LENGTHS)
    cubes = {name: f.mean_bending / (f.density * fabrics.GRAVITY) for name, f in FABRICS.items()}
    found = {name: 1e3 * cube ** (1 / 3) for name, cube in cubes.items()}
    # Values of the ten fabrics are means of five directions, ours of three.
    assert found == pytest.approx(GRAVITY_LENGTHS, rel=0.01)


def test_every_number_says_where_it_comes_from():
    numbers = {f.name for f in dataclasses.fields(fabrics.FabricData)}
    numbers -= {"name", "summary", "origin", "source", "license"}
    for fabric in FABRICS.values():
        assert set(fabric.origin) == numbers
        assert set(fabric.origin.values()) <= {MEASURED, FITTED, ASSUMED}
        assert fabric.source and fabric.license


def test_a_sheet_is_made_of_a_named_fabric():
    cloth = Cloth(fabric=Fabric.named("gray_interlock"))
    model = mujoco.MjModel.from_xml_string(
        cloth.mjcf_model.to_xml_string(), cloth.mjcf_model.get_assets()
    )
    # 0.59375 m by 0.35625 m of 0.187 kg/m^2.
    assert model.body_mass.sum() == pytest.approx(0.59375 * 0.35625 * 0.187, rel=1e-6)
    (instance,) = cloth.mjcf_model.extension.plugin[0].instance
    material = {config.key: float(config.value) for config in instance.config}
    # (33 + 69) / 2, of a grid that shows 0.8915 of it with diagonals of 0.3.
    assert material["stretch"] == pytest.approx(51.0 / 0.8915, rel=1e-4)
    for bend in ("bend", "bend_weft", "bend_bias"):
        assert material[bend] == pytest.approx(5.2e-6)  # (5.8 + 6.2 + 3.6) / 3 uN m


def test_a_fabric_bends_and_shears_as_was_measured_if_it_is_asked_to():
    fabric = Fabric.named("black_denim", anisotropic=True, measured_shear=True)
    bends = fabric.bend_stiffness, fabric.bend_bias, fabric.bend_weft
    assert bends == pytest.approx((16.0e-6, 18.3e-6, 24.2e-6))
    # Half of the cells' diagonals, of springs of stretch / 1.2 / 2 each, resist 27 N/m.
    assert fabric.shear * fabric.stretch_stiffness / 4.8 == pytest.approx(27.0)
    assert Fabric.named("gray_interlock", measured_shear=True).shear == 1.0  # As far as that goes.


@pytest.mark.parametrize("name", ["silk", None, 3])
def test_an_unknown_fabric_lists_those_that_there_are(name):
    with pytest.raises(InvalidArgumentError, match=r"fabric=.*'gray_interlock'.*'flex_nominal'"):
        Fabric.named(name)
