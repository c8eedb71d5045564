"""Visual domain parameters: each changes images, and none changes motion."""

import hashlib
import subprocess
import sys

import imageio.v3 as imageio
import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.lights import WHITE, warmth
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering import CameraView
from softgym_mj.rendering.textures import PAD, STRIP, weave
from softgym_mj.variations.randomization import DomainRandomization, decode_choice

TASKS = ("fold_cloth", "straighten_rope", "pour_water")  # One of each kind of object.
SENSOR = {"sensor_noise": 4.0, "sensor_blur": 0.5, "sensor_quality": 70.0, "sensor_exposure": 1.1}
OWN = ("hue", "brightness", "pattern", "opacity")  # Parameters of objects.
# What counts as seen [1/255]: by a pixel of those 0.2 % that change most; ropes cover 1 %.
LEAST, MOST_CHANGED = 6.0, 99.8
# What is seen only with another: hues of what is gray, the scale of what is plain.
BESIDE = {
    "table_hue": {"table_saturation": 0.1},
    "backdrop_hue": {"backdrop_saturation": 0.1},
    "table_scale": {"table_pattern": 1.0},
}


def load(task, **settings):
    return softgym_mj.load(
        task, split="evaluate", fidelity="fast", **{"image_size": (48, 48)} | settings
    )


@pytest.mark.parametrize("task", ["drop_cloth", "straighten_rope", "pour_water"])
def test_each_visual_parameter_is_seen_and_not_felt(task):
    env = load(task, observation="rgb")
    domain = env.task.domain
    visual = {p.name: p for p in domain.parameters if p.kind != "physics"}
    if task != "drop_cloth":  # It shows what all scenes have.
        visual = {name: p for name, p in visual.items() if name in OWN}

    def seen(**values):
        """The picture with these parameters and nominal others; states have to be the same."""
        domain.ranges = {p.name: ((values.get(p.name, p.nominal),) * 2,) for p in domain.parameters}
        image = env.reset(806).observation["rgb"]
        # The task's camera looks down at the table alone.
        image = np.hstack([image, CameraView("overview", 48, 48).rgb(env.physics)]).astype(float)
        states.add(env.task.points().tobytes() + env.physics.data.qpos.tobytes())
        return image

    states = set()
    nominal = seen()
    for name, parameter in visual.items():
        other = BESIDE.get(name, {})
        before = seen(**other) if other else nominal
        low, high = parameter.valid
        end = low if high == parameter.nominal else high
        change = np.abs(seen(**other, **{name: end}) - before).max(axis=-1)
        assert np.percentile(change, MOST_CHANGED) > LEAST, (name, end)
    np.testing.assert_array_equal(seen(), nominal)
    assert len(states) == 1


@pytest.mark.parametrize("task", [*TASKS, "drop_cloth"])
def test_what_is_only_seen_changes_no_state(task):
    plain, varied = load(task), load(task, domain={"visual": "out_of_distribution"})
    assert {p.name for p in varied.task.domain.parameters if p.kind != "physics"} == set(
        varied.task.domain.varying
    )
    for env in (plain, varied):
        env.reset(801), env.reset(807)
    for action in np.random.default_rng(0).uniform(-1, 1, (4, *plain.action_spec().shape)):
        a, b = plain.step(action), varied.step(action)
        assert a.observation["reduced"].tobytes() == b.observation["reduced"].tobytes()
        assert a.reward == b.reward
    assert plain.task.points().tobytes() == varied.task.points().tobytes()
    assert plain.physics.data.qvel.tobytes() == varied.physics.data.qvel.tobytes()


def test_kinds_stand_for_their_parameters():
    parameters = load("straighten_rope").task.domain.parameters
    for setting, kinds in (
        ({"visual": "in_distribution"}, {"visual", "sensor"}),
        ({"visual": "in_distribution", "sensor": "nominal"}, {"visual"}),
        ({"sensor": "out_of_distribution"}, {"sensor"}),
        ({"physics": "in_distribution"}, {"physics"}),
    ):
        env = load("straighten_rope", domain={**setting, "hue": 5.0})
        varying = set(env.task.domain.varying)
        assert varying - {"hue"} == {p.name for p in parameters if p.kind in kinds} - {"hue"}
        assert env.task.domain.draw(3)["hue"] == 5.0
    with pytest.raises(InvalidArgumentError, match=r"visual=0\.5"):
        load("straighten_rope", domain={"visual": 0.5})


def test_the_sensor_sees_for_the_observation_alone():
    names = ["rgb", "depth", "segmentation"]
    plain, faulty = (load("fold_cloth", observation=names, domain=d) for d in ({}, SENSOR))
    a, b = plain.reset(806).observation, faulty.reset(806).observation
    assert np.abs(a["rgb"].astype(float) - b["rgb"]).mean() > 2.0
    assert a["depth"].tobytes() == b["depth"].tobytes()
    assert a["segmentation"].tobytes() == b["segmentation"].tobytes()
    drawn = CameraView("task", 48, 48, marks=False).rgb(faulty.physics)
    assert drawn.tobytes() == a["rgb"].tobytes()


def shot():
    """The image after two steps, as a digest."""
    env = load("straighten_rope", observation="rgb", domain={"visual": "in_distribution"})
    env.reset(804)
    for _ in range(2):
        image = env.step(np.full(8, 0.5)).observation["rgb"]
    return hashlib.sha256(image.tobytes()).hexdigest()


def test_images_are_the_same_in_another_process():
    code = f"import {__name__} as here; print(here.shot())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == shot()


def test_noise_is_of_the_variation_and_the_step_not_of_the_images_taken():
    settings = {"observation": "rgb", "domain": SENSOR}
    env, twin = load("straighten_rope", **settings), load("straighten_rope", **settings)
    first = env.reset(803).observation["rgb"]
    assert env.observation()["rgb"].tobytes() == first.tobytes()
    images = [env.step(np.zeros(8)).observation["rgb"] for _ in range(2)]
    snapshot = env.get_state()
    last = env.step(np.zeros(8)).observation["rgb"]
    assert not np.array_equal(images[0], images[1])  # All is still, but for the noise.
    twin.reset(805)
    twin.set_state(snapshot)
    for _ in range(2):
        assert twin.observation()["rgb"].tobytes() == images[1].tobytes()
    assert twin.step(np.zeros(8)).observation["rgb"].tobytes() == last.tobytes()


@pytest.mark.parametrize("preset", ["in_distribution", "out_of_distribution"])
def test_sides_and_strip_of_a_cloth_stay_apart(preset):
    cloth = Cloth(marker=True)
    domain = DomainRandomization({"visual": preset}, [cloth])
    for variation in range(25):
        domain.apply(variation)
        pixels = imageio.imread(cloth.mjcf_model.find("texture", "weave").file.contents) / 255.0
        size = pixels.shape[0]
        panels, columns = np.split(pixels, 2, axis=1), (np.arange(size) + 0.5) / size
        inside = (columns - PAD) / (1.0 - 2.0 * PAD)
        strip = (inside > STRIP[0]) & (inside < STRIP[1])
        around = (inside > 0.2) & (inside < 0.9)
        means = [[panel[:, part].mean((0, 1)) for part in (strip, around)] for panel in panels]
        (front_strip, front), (back_strip, back) = means
        assert np.linalg.norm(front - back) > 0.2, domain.values
        assert np.linalg.norm(front_strip - front) > 0.2, domain.values
        assert np.linalg.norm(back_strip - back) > 0.2, domain.values
    assert weave.cache_info().currsize <= 8  # What is random never comes again.


def test_the_whole_part_of_a_number_chooses():
    assert decode_choice(0.0, 3) == (0, 0) and decode_choice(1.5, 3) == (1, 2**31)
    assert decode_choice(3.0, 3)[0] == 2
    numbers = []
    for lamps in (0.0, 1.4, 2.9):
        env = load("straighten_rope", domain={"lamps": lamps})
        env.reset(800)
        numbers.append(env.physics.model.nlight)
    assert numbers == [3, 4, 5]


def test_light_is_as_warm_as_a_black_body():
    """Planck's law at 600, 550 and 450 nm, in pixels."""
    power = [1 / (np.exp(0.014388 / (nm * 1e-9) / 3000.0) - 1) for nm in (600, 550, 450)]
    white = [1 / (np.exp(0.014388 / (nm * 1e-9) / WHITE) - 1) for nm in (600, 550, 450)]
    ratio = np.divide(power, white) / (power[1] / white[1])
    np.testing.assert_allclose(warmth(3000.0), ratio ** (1 / 2.2), rtol=1e-9)
    assert warmth(WHITE).tolist() == [1.0, 1.0, 1.0]
