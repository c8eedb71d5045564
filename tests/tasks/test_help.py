"""`help` names what constructors of tasks take, with units."""

import inspect
import pydoc
import re

import pytest

import softgym_mj

SHARED = pydoc.plain(pydoc.render_doc("softgym_mj.tasks.shared.settings"))


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_it_explains_every_argument_once(task):
    record = softgym_mj.TASKS[task]
    own = pydoc.getdoc(record.resolve().__init__)
    assert 'help("softgym_mj.tasks.shared.settings")' in own
    for name in record.arguments:
        assert (own + SHARED).count(f"  {name}: ") == 1, name


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_the_class_is_exported_and_tells_the_task(task):
    record = softgym_mj.TASKS[task]
    exported = getattr(softgym_mj.tasks, record.class_name)
    assert exported is record.resolve()
    text = inspect.getdoc(exported)
    labels = re.findall(
        "^(Goal|Actions|Observations|Reward|Bounds|Horizon|Start)", text, re.MULTILINE
    )
    assert len(labels) == len(set(labels)) == 7
    assert f"Horizon: {record.horizon} env steps of {record.action_repeat} sim steps" in text
    env = softgym_mj.load(task, observation="reduced")
    size = env.observation_spec()["reduced"].shape[0]
    assert f"{size} entries" in " ".join(text.split())


def test_it_tells_units():
    assert "image_size: (height, width) of images [pixels].\n" in SHARED
