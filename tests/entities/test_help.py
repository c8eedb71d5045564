"""`help` of entities names their arguments, with units and defaults, and so do errors."""

import inspect
import pydoc

import pytest

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.garment import Garment
from softgym_mj.entities.rope import Rope
from softgym_mj.entities.shirt import Shirt
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    UnexpectedArgumentError,
)
from softgym_mj.fluid.water import Liquid, Resolution, Water
from softgym_mj.robots.pick_and_place import PickAndPlace
from softgym_mj.robots.picker import Picker


@pytest.mark.parametrize("entity", [Cloth, Cup, Garment, Rope, Shirt])
def test_it_shows_what_building_takes(entity):
    _, *built = inspect.signature(entity._build).parameters.values()
    assert [*inspect.signature(entity).parameters.values()] == built
    text = pydoc.plain(pydoc.render_doc(entity))
    assert f"class {entity.__name__}(" in text and "Entity constructor" not in text
    for parameter in built:
        assert f"{parameter.name}: " in text


def test_it_tells_units():
    text = " ".join(pydoc.plain(pydoc.render_doc(Cloth)).replace("|", "").split())
    assert "size: side lengths (along X, along Y) [m]" in text


def test_a_class_that_builds_the_same_shows_the_same():
    class Towel(Cloth):
        """One that adds a method."""

    assert inspect.signature(Towel) == inspect.signature(Cloth)
    assert Towel((0.3, 0.3)).dims == (49, 49)
    assert inspect.signature(PickAndPlace) == inspect.signature(Picker)  # It passes all on.


def test_a_class_that_builds_more_is_built_once():
    class Towel(Cloth):
        """One with an argument of its own."""

        built = 0

        def _build(self, width: float):
            self.built += 1
            super()._build(size=(width, width))

    assert [*inspect.signature(Towel).parameters] == ["width"]
    towel = Towel(0.3)
    assert towel.built == 1 and towel.dims == (49, 49)


def test_a_class_with_a_constructor_keeps_it():
    class Towel(Cloth):
        """One whose constructor takes what `_build` does not."""

        def __init__(self, owner: str):
            super().__init__(owner, 0.3)
            self.owner = owner

        def _build(self, owner: str, width: float):
            super()._build(size=(width, width))

    assert [*inspect.signature(Towel).parameters] == ["owner"]
    assert Towel("me").owner == "me" and Towel("me").dims == (49, 49)


@pytest.mark.parametrize("entity", [Cloth, Cup, Garment, PickAndPlace, Picker, Rope, Shirt])
def test_an_unexpected_argument_lists_every_argument(entity):
    listed = ", ".join(map(repr, inspect.signature(entity).parameters))
    message = rf"^{entity.__name__} got an unexpected .* 'smell'; valid choices: {listed}\.$"
    with pytest.raises(UnexpectedArgumentError, match=message):
        entity(smell=1)


def test_a_class_passes_on_arguments_of_its_own():
    class Towel(Cloth):
        """One with an argument of its own."""

        def _build(self, width: float, **settings: float):
            super()._build(size=(width, width), **settings)

    assert Towel(width=0.3, name="towel").mjcf_model.model == "towel"
    with pytest.raises(TypeError, match="smell"):
        Towel(width=0.3, smell=1)


@pytest.mark.parametrize(
    "read",
    [
        lambda: Cloth().points(),
        lambda: Rope().set_points(Rope().straight()),
        lambda: Rope().edges,
        lambda: Rope().hold(0),
        lambda: Rope().twist_angle,
        lambda: Water(Liquid(2e-4), Resolution(8, 0.018, (2, 2))).points(),
    ],
)
def test_what_is_not_compiled_has_no_state(read):
    with pytest.raises(LifecycleError, match="is not compiled: call compile"):
        read()


def test_an_arena_attaches_entities():
    with pytest.raises(InvalidArgumentError, match="entity=5 is not valid"):
        Arena().attach(5)
