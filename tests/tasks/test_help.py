"""`help` of tasks names what their constructors take, with units."""

import inspect
import pydoc
from typing import Unpack

import pytest

import softgym_mj
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.settings import TaskSettings


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_it_shows_every_argument(task):
    record = softgym_mj.TASKS[task]
    cls = record.resolve()
    assert [*inspect.signature(cls).parameters] == [*record.arguments]
    text = pydoc.plain(pydoc.render_doc(cls.__init__))
    for name in record.arguments:
        assert text.count(f"    {name}: ") == 1, name
    assert "image_size: (height, width) of images [pixels].\n" in text
    meshes = 'visual: what arms look like: "primitive", our own shapes (as with None), or'
    assert meshes in text and "\n            meshes of MuJoCo Menagerie. Only for arms.\n" in text


def test_that_of_a_task_of_ones_own():
    class Own(Task):
        """Adds an argument and has one otherwise."""

        def __init__(self, weight: float, *, look: str = "paper", **settings: Unpack[TaskSettings]):
            """Builds it.

            Args:
                weight: of all [kg].

            Raises:
                ValueError: never.
            """
            super().__init__([], look=look, **settings)

    parameters = inspect.signature(Own).parameters
    assert [*parameters][:3] == ["weight", "look", "actor"]
    assert parameters["look"].default == "paper" and parameters["arms"].annotation == int | None
    assert parameters["observation"].default == "reduced"
    said = inspect.getdoc(Own.__init__)
    assert said.startswith("Builds it.\n\nArgs:\n    look: ") and "\n    arms: " in said
    assert said.endswith("\n    weight: of all [kg].\n\nRaises:\n    ValueError: never.")
