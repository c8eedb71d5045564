"""`help` names what constructors of tasks take, with units."""

import pydoc

import pytest

import softgym_mj

SHARED = pydoc.plain(pydoc.render_doc("softgym_mj.tasks.shared.settings"))


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_it_explains_every_argument_once(task):
    record = softgym_mj.TASKS[task]
    own = pydoc.plain(pydoc.render_doc(record.resolve().__init__))
    assert 'help("softgym_mj.tasks.shared.settings")' in own
    for name in record.arguments:
        assert (own + SHARED).count(f"  {name}: ") == 1, name


def test_it_tells_units():
    assert "image_size: (height, width) of images [pixels].\n" in SHARED
