"""Domain parameters: what is drawn, and that the compiled scene has it."""

import math

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.domain import Domain, scaled, shifted, turned
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import DEFAULT_DIMS, Cloth
from softgym_mj.entities.sheet import BEND_STIFFNESS, POISSON, STRETCH_STIFFNESS, YOUNG
from softgym_mj.exceptions import OutOfRangeError, SnapshotError, UnknownNameError

TASKS = ("straighten_rope", "spread_cloth", "pour_water")  # One of each kind of object.


class Part:
    """A scene's part that notes what it is told."""

    parameters = (
        scaled("weight", "kg", 2.0, 1.5, 3.0, ""),
        shifted("offset", "m", 0.1, 0.5, ""),
    )

    def __init__(self):
        self.values = {}

    def adjust(self, values):
        changed, self.values = values != self.values, dict(values)
        return changed


def load(task, **settings):
    return softgym_mj.load(task, split="evaluate", **settings)


def drawn(setting):
    domain = Domain(setting, [Part()])
    return {
        name: np.array([domain.draw(i)[name] for i in range(1000)]) for name in ("weight", "offset")
    }


def test_in_distribution_draws_evenly_from_the_usual_ranges():
    values = drawn("in_distribution")
    for part, low, high in (
        (np.log(values["weight"]), math.log(2.0 / 1.5), math.log(3.0)),
        (values["offset"], -0.1, 0.1),
    ):
        assert part.min() >= low - 1e-12 and part.max() <= high + 1e-12
        # Mean and standard deviation of a uniform variable, within three standard errors.
        width = high - low
        assert part.mean() == pytest.approx((low + high) / 2, abs=3 * width / math.sqrt(12_000))
        assert part.std() == pytest.approx(width / math.sqrt(12), rel=0.06)


def test_out_of_distribution_draws_from_both_sides_of_the_usual_ranges():
    values = drawn("out_of_distribution")
    for part, (outer, inner, upper, outermost) in (
        (values["weight"], (2.0 / 3.0, 2.0 / 1.5, 3.0, 6.0)),
        (values["offset"], (-0.5, -0.1, 0.1, 0.5)),
    ):
        below, above = part[part <= inner], part[part >= upper]
        assert len(below) + len(above) == 1000
        assert 450 < len(below) < 550  # Both sides are as long: 500, sigma 16.
        assert below.min() >= outer and above.max() <= outermost


def test_a_draw_depends_on_the_parameter_and_the_variation_alone():
    both = Domain("in_distribution", [Part()])
    one = Domain({"offset": "in_distribution"}, [Part()])
    assert [both.draw(i)["offset"] for i in (0, 7)] == [one.draw(i)["offset"] for i in (0, 7)]
    assert one.draw(0)["offset"] != one.draw(7)["offset"]
    assert one.draw(7)["weight"] == 2.0
    assert one.varying == ("offset",) and both.varying == ("weight", "offset")


def test_numbers_and_pairs():
    domain = Domain({"weight": 5, "offset": (0.2, 0.3)}, [part := Part()])
    assert domain.apply(3) and part.values["weight"] == 5.0
    assert 0.2 <= part.values["offset"] <= 0.3
    assert not domain.apply(3)
    assert domain.values == part.values


@pytest.mark.parametrize(
    ("setting", "error", "words"),
    [
        ("usual", UnknownNameError, ("domain='usual'", "in_distribution", "weight, offset")),
        (3, UnknownNameError, ("domain=3", "out_of_distribution")),
        ({"mass": 1.0}, UnknownNameError, ("domain parameter='mass'", "'weight', 'offset'")),
        ({"weight": 7.0}, OutOfRangeError, ("weight=7.0", "6.0", "kg")),
        ({"weight": (3.0, 2.0)}, OutOfRangeError, ("weight=(3.0, 2.0)",)),
        ({"weight": (1.0, 2.0, 3.0)}, OutOfRangeError, ("weight=(1.0, 2.0, 3.0)",)),
        ({"weight": math.nan}, OutOfRangeError, ("weight=nan",)),
        ({"weight": None}, OutOfRangeError, ("weight=None",)),
        ({"weight": "light"}, UnknownNameError, ("weight='light'", "nominal")),
    ],
)
def test_bad_settings_say_what_is_valid(setting, error, words):
    with pytest.raises(error) as raised:
        Domain(setting, [Part()])
    for word in words:
        assert word in str(raised.value)


def test_turned_colours():
    assert turned((1.0, 0.0, 0.0, 0.5), 120.0) == pytest.approx((0.0, 1.0, 0.0, 0.5))
    assert turned((1.0, 0.5, 0.0, 1.0), -30.0) == pytest.approx((1.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize("task", TASKS)
def test_a_nominal_domain_changes_no_bit(task):
    plain, nominal = load(task), load(task, domain={"hue": 0.0, "camera_x": (0.0, 0.0)})
    random = np.random.default_rng(0)
    plain.reset(801), nominal.reset(801)
    for _ in range(3):
        action = random.uniform(-1, 1, plain.action_spec().shape)
        plain.step(action), nominal.step(action)
    assert plain.physics.data.qpos.tobytes() == nominal.physics.data.qpos.tobytes()
    assert plain.task.points().tobytes() == nominal.task.points().tobytes()
    assert plain.info() == nominal.info()


def test_the_cloth_has_what_was_drawn():
    env = load("spread_cloth", domain="out_of_distribution")
    seen = []
    for variation in (800, 801):
        env.reset(variation)
        values, cloth, model = env.task.domain.values, env.task.cloth, env.physics.model.ptr
        seen.append(values["density"])
        bodies = model.flex_vertbodyid
        assert model.body_mass[bodies].sum() == pytest.approx(
            values["density"] * cloth.size[0] * cloth.size[1]
        )
        assert model.flex_friction[0, 0] == pytest.approx(values["friction"])
        mujoco.mj_forward(model, env.physics.data.ptr)
        contacts = env.physics.data.ptr.contact
        on_floor = contacts.friction[contacts.geom[:, 0] == model.geom("floor").id, 0]
        assert len(on_floor) and np.all(on_floor == values["friction"])
        assert values["layer_friction"] == pytest.approx(
            env.info()["domain_layer_friction"], abs=0.0
        )
    assert seen[0] != seen[1]


def pulled(cloth, strain):
    """Force [N] across the middle of a sheet whose rows are pulled apart by `strain`."""
    physics = compiled(cloth)
    flat = cloth.flat()
    cloth.set_vertices(flat * [1.0, 1.0 + strain, 1.0] + [0.0, 0.0, 1.0])
    return -forces(cloth, physics)[flat[:, 1] > 0.001, 1].sum()


def bent(cloth, radius):
    """Work [J] to bend a sheet to a cylinder: half of force times displacement."""
    cloth.mjcf_model.worldbody.flexcomp[0].elasticity.elastic2d = "bend"
    physics = compiled(cloth)
    flat = cloth.flat() + [0.0, 0.0, 1.0]
    angle = flat[:, 0] / radius
    moved = [radius * np.sin(angle), flat[:, 1], 1.0 + radius * (1.0 - np.cos(angle))]
    cloth.set_vertices(np.column_stack(moved))
    return -0.5 * np.sum(forces(cloth, physics) * (np.column_stack(moved) - flat))


def compiled(cloth):
    arena = Arena(camera="cloth")
    arena.attach(cloth)
    return arena.compile(cloth.timestep, cloth)


def forces(cloth, physics):
    """Elastic forces on the vertices (n, 3) [N]."""
    model, data = physics.model.ptr, physics.data.ptr
    mujoco.mj_forward(model, data)
    return data.qfrc_passive[-3 * cloth.num_vertices :].reshape(-1, 3)


@pytest.mark.parametrize("factor", [1.0, 0.5, 2.0])
def test_stiffness_is_force_per_width_and_strain(factor):
    """With the width held, the force is larger by 1 / (1 - Poisson's ratio^2)."""
    cloth = Cloth(dims=(60, 58), self_contact="none")
    nominal = {parameter.name: parameter.nominal for parameter in cloth.parameters}
    cloth.adjust({**nominal, "stretch_stiffness": factor * STRETCH_STIFFNESS})
    expected = factor * STRETCH_STIFFNESS / (1 - POISSON**2) * cloth.size[0] * 1e-3
    assert pulled(cloth, 1e-3) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("factor", [1.0, 0.2, 5.0])
def test_bending_stiffness_is_moment_per_width_and_curvature(factor):
    """A cylinder of curvature k holds the energy B k^2 / 2 per area."""
    cloth = Cloth(dims=(119, 119), self_contact="none")
    nominal = {parameter.name: parameter.nominal for parameter in cloth.parameters}
    cloth.adjust({**nominal, "bend_stiffness": factor * BEND_STIFFNESS})
    expected = factor * BEND_STIFFNESS / 2 / 1.5**2 * cloth.size[0] * cloth.size[1]
    assert bent(cloth, 1.5) == pytest.approx(expected, rel=0.05)


def test_parameters_survive_a_change_of_size():
    cloth = Cloth()
    nominal = {parameter.name: parameter.nominal for parameter in cloth.parameters}
    before = cloth.physical_parameters
    assert cloth.adjust({**nominal, "stretch_stiffness": 50.0})
    young = cloth.mjcf_model.worldbody.flexcomp[0].elasticity.young
    cloth.resize((70, 80))
    assert cloth.mjcf_model.worldbody.flexcomp[0].elasticity.young == young > YOUNG
    cloth.resize(DEFAULT_DIMS)
    assert cloth.adjust(nominal) and cloth.physical_parameters == before


def test_the_rope_has_what_was_drawn():
    env = load("straighten_rope", domain="in_distribution")
    env.reset(805)
    values, model = env.task.domain.values, env.physics.model.ptr
    assert model.body_mass[model.flex_vertbodyid].sum() == pytest.approx(values["density"] * 0.5)
    assert model.flex_friction[0, 0] == pytest.approx(values["friction"])
    bending = []
    for stiffness in (1e-5, 2e-5):
        env = load("straighten_rope", domain={"bend_stiffness": stiffness})
        env.reset(805)
        bending.append(env.physics.model.ptr.flex_bending.copy())
    assert np.any(bending[0] != bending[1])
    changed = bending[0] != bending[1]
    np.testing.assert_allclose(bending[1][changed], 2.0 * bending[0][changed])


def test_viscous_water_comes_to_rest_sooner():
    speeds = []
    for viscosity in (2e-4, 5e-3):
        env = load("pour_water", domain={"viscosity": viscosity})
        env.reset(803)
        for _ in range(3):
            env.step(np.array([1.0, 0.0, 0.0]))
        for _ in range(6):
            env.step(np.zeros(3))
        speeds.append(np.linalg.norm(env.task.water.velocities(), axis=1).mean())
    assert speeds[1] < 0.5 * speeds[0]


def test_the_camera_moves_and_turns_as_told():
    plain = load("straighten_rope")
    plain.reset(800)
    env = load(
        "straighten_rope",
        domain={"camera_x": 0.05, "camera_z": -0.02, "camera_roll": 3.0, "camera_tilt": 2.0},
    )
    env.reset(800)
    mujoco.mj_forward(plain.physics.model.ptr, plain.physics.data.ptr)
    mujoco.mj_forward(env.physics.model.ptr, env.physics.data.ptr)
    before, after = (e.physics.data.ptr.camera("task") for e in (plain, env))
    np.testing.assert_allclose(after.xpos - before.xpos, [0.05, 0.0, -0.02], atol=1e-12)
    # The rope's camera looks down with its axes along the world's: tilt about X, then roll.
    tilt, roll = np.deg2rad(2.0), np.deg2rad(3.0)
    about_x = [
        [1.0, 0.0, 0.0],
        [0.0, np.cos(tilt), -np.sin(tilt)],
        [0.0, np.sin(tilt), np.cos(tilt)],
    ]
    about_z = [
        [np.cos(roll), -np.sin(roll), 0.0],
        [np.sin(roll), np.cos(roll), 0.0],
        [0.0, 0.0, 1.0],
    ]
    np.testing.assert_allclose(
        after.xmat.reshape(3, 3), np.array(about_x) @ np.array(about_z), atol=1e-9
    )


def test_snapshots_restore_the_domain_and_refuse_another_one():
    env, twin = (load("straighten_rope", domain="in_distribution") for _ in range(2))
    env.reset(803), twin.reset(804)
    env.step(np.ones(8))
    twin.set_state(env.get_state())
    assert twin.task.domain.values == env.task.domain.values
    for action in np.random.default_rng(0).uniform(-1, 1, (5, 8)):
        assert (
            env.step(action).observation["reduced"].tobytes()
            == twin.step(action).observation["reduced"].tobytes()
        )
    with pytest.raises(SnapshotError, match="density"):
        load("straighten_rope").set_state(env.get_state())


@pytest.mark.parametrize("preset", ["in_distribution", "out_of_distribution"])
@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_random_actions_stay_finite_in_every_domain(task, preset):
    env = load(task, domain=preset, observation=["full", "rgb"], image_size=(32, 32))
    random = np.random.default_rng(0)
    for variation in (800, 801):
        env.reset(variation)
        for _ in range(5):
            timestep = env.step(random.uniform(-1, 1, env.action_spec().shape))
            assert np.isfinite(timestep.observation["full"]).all()
        assert env.info()["physics_warnings"] == 0
