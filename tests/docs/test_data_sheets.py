"""Data sheets equal the generated ones, and their entries add up."""

import re

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.robots.arm.models import ARMS
from tests.kinds import by_material
from tools import data_sheets, interface_page, sheet_entries

STATES = ("full", "reduced", "markov", "key_points", "proprioception")
CASES = [
    *((task, {}) for task in softgym_mj.TASKS),
    ("straighten_rope", {"actor": "sawyer", "arms": 1}),
    ("straighten_rope", {"actor": "picker", "num_pickers": 3}),
    ("straighten_rope", {"actor": "pixel_pick_and_place"}),
    ("rope_configuration", {"actor": "franka"}),
    ("transport_water", {"actor": "sawyer"}),
    ("pour_water_amount", {"actor": "franka"}),
]


@pytest.mark.parametrize("task", by_material())
def test_sheets_are_up_to_date(task):
    written = (data_sheets.FOLDER / f"{task}.md").read_text()
    assert written == data_sheets.sheet(task), "run `make sheets`"


@pytest.mark.long  # It builds every task with every actor.
def test_the_page_of_common_entries_is_up_to_date():
    assert interface_page.FILE.read_text() == interface_page.page(), "run `make sheets`"


def test_keys_of_info_are_explained_once_and_listed_on_the_sheets():
    common = {key for keys in sheet_entries.COMMON.values() for key in keys}
    page = interface_page.FILE.read_text()
    for name in softgym_mj.TASKS:
        sheet = (data_sheets.FOLDER / f"{name}.md").read_text()
        (listed,) = re.findall("^Terms of the reward: (.*)$", sheet, re.MULTILINE)
        env = softgym_mj.load(name)
        env.reset(800)
        for key in env.info():
            assert page.count(f"| `{key}` |") == (not key.startswith("reward_")), key
            assert (f"`{key}`" in listed) != (key in common), key


def test_there_is_a_sheet_for_every_task_and_no_other():
    assert {path.stem for path in data_sheets.FOLDER.iterdir()} == set(softgym_mj.TASKS)
    assert all(set(ARMS) < set(task.resolve().actors) for task in softgym_mj.TASKS.values())


def test_observations_have_the_sizes_and_dtypes_of_the_pages():
    sheet = (data_sheets.FOLDER / "fold_cloth.md").read_text()
    page = interface_page.FILE.read_text()
    names = [*STATES, "full_mask", "rgb", "depth"]
    in_dm_env = softgym_mj.load("fold_cloth", observation=names).observation_spec()
    in_gymnasium = gymnasium.make("softgym_mj/FoldCloth-v0", observation=names).observation_space
    for name in (*STATES, "full_mask"):
        assert f"`{name}` {in_dm_env[name].shape[0]}" in sheet
    for name in STATES:
        dtypes = in_dm_env[name].dtype, in_gymnasium[name].dtype
        assert "States are {} in dm_env and {} in Gymnasium.".format(*dtypes) in page
    for name in ("full_mask", "rgb", "depth"):
        assert in_dm_env[name].dtype == in_gymnasium[name].dtype
        assert f"| `{name}` | {in_dm_env[name].dtype}" in page


def test_entries_of_all_corners_or_grippers_have_one_row():
    corners = {f"corner p{i} (x, y, z) [m]": 3 for i in (1, 2)}
    grippers = {"gripper 0, grip": 1, "gripper 0, dx": 1, "gripper 1, grip": 1}
    entries = corners | {"share": 1} | grippers | {"arm 0, joints": 7}
    assert list(sheet_entries.merged(entries)) == [
        ("0 to 5", "corners p1, p2 (x, y, z each) [m]"),
        ("6", "share"),
        ("7, 9", "grippers 0, 1: grip"),
        ("8", "gripper 0, dx"),
        ("10 to 16", "arm 0, joints"),
    ]


@pytest.mark.parametrize(("name", "settings"), CASES, ids=str)
def test_entries_of_the_states_add_up(name, settings):
    env = softgym_mj.load(name, observation=(*STATES, "full_mask"), **settings)
    spec, task = env.observation_spec(), env.task
    for observation, entries in (
        ("reduced", sheet_entries.reduced_entries(task)),
        ("markov", sheet_entries.reduced_entries(task) | task.actor.remembers),
        ("full", sheet_entries.full_entries(env)),
        ("proprioception", task.actor.senses),
    ):
        assert spec[observation].shape == (sum(entries.values()),)


def named(state, entries):
    """The numbers of a state by the names of its entries."""
    ends = np.cumsum(list(entries.values()))
    return dict(zip(entries, np.split(state, ends[:-1]), strict=True))


@pytest.mark.parametrize("name", ["straighten_rope", "pour_water"])
def test_arms_sense_what_the_sheet_says(name):
    env = softgym_mj.load(name, actor="franka")
    env.reset(800)
    entries = env.task.actor.senses
    seen = named(env.task.actor.proprioception(), entries)
    for key, values in seen.items():
        assert "quaternion" not in key or np.linalg.norm(values) == pytest.approx(1.0)
        assert "opening" not in key or 0.0 <= values[0] <= 0.08  # What a Franka's hand opens to.
    joints = np.concatenate([values for key, values in seen.items() if "positions" in key])
    data = env.physics.data.ptr
    assert np.isin(joints, data.qpos).all()
    points = np.array([values for key, values in seen.items() if "tool point" in key])
    model = env.physics.model.ptr
    name = env.task.actor.arm.tcp_site
    sites = [i for i in range(model.nsite) if model.site(i).name.endswith(name)]
    np.testing.assert_allclose(points, data.site_xpos[sites], atol=1e-6)


def test_the_reduced_state_of_cups_is_what_the_sheet_says():
    env = softgym_mj.load("pour_water_amount")
    env.reset(812)
    task = env.task
    seen = named(task.observe("reduced"), sheet_entries.reduced_entries(task))
    cup, target = task.cup.size, task.target.size
    assert seen["cup inner length, width, height [m]"] == pytest.approx(
        [cup.length, cup.width, cup.height]
    )
    assert seen["target height, inner length, inner width [m]"] == pytest.approx(
        [target.height, target.length, target.width]
    )
    assert seen["target x [m]"] == pytest.approx(task.target.pose[0])
    assert seen["share t to be poured"] == pytest.approx(float(task.episode.goal["share"]))
