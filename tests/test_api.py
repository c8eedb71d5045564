"""The public interface: docstrings, shapes of arrays, and completion that shows no more."""

import importlib
import inspect
import pkgutil
import re
import rlcompleter

import numpy as np
import pytest

import softgym_mj

# Modules of commands: typer turns their docstrings into help.
COMMANDS = re.compile(r"softgym_mj\.cli")
MODULES = [
    module.name
    for module in pkgutil.walk_packages(softgym_mj.__path__, "softgym_mj.")
    if not COMMANDS.match(module.name)
]


def public(module):
    """(name, object, docstring) of what a module defines for others, members of classes too."""
    for name, value in vars(module).items():
        if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(value):
            yield name, value, value.__doc__
            for key, member in vars(value).items():
                own = getattr(member, "fget", getattr(member, "__func__", member))
                named = inspect.isfunction(own) and own.__name__ != "<lambda>"
                if named and not key.startswith("_"):
                    yield f"{name}.{key}", own, inspect.getdoc(_found(value, key))
        elif inspect.isfunction(value):
            yield name, value, value.__doc__


def _found(owner, key):
    member = inspect.getattr_static(owner, key)
    return member if isinstance(member, property) else getattr(owner, key)


@pytest.mark.parametrize("name", MODULES)
def test_everything_has_a_docstring_of_its_own_and_arrays_have_shapes(name):
    """Docstrings of functions that return an array have its shape, or a reference, in brackets."""
    module = importlib.import_module(name)
    assert module.__doc__ and module.__doc__.strip()
    assert [symbol for symbol, _, text in public(module) if not text] == []
    # Neither a noun phrase nor a sentence: "Of the cloth.", "As of `Side`.", "See `X`."
    fragment = re.compile(r"(As of|In|Of|See|That|The same|What|Where|Whose) ")
    texts = [("", module.__doc__), *((symbol, text) for symbol, _, text in public(module))]
    assert [symbol for symbol, text in texts if fragment.match(text)] == []
    shapeless = [
        symbol
        for symbol, function, text in public(module)
        if inspect.isfunction(function)
        and inspect.get_annotations(function).get("return") is np.ndarray
        and not re.search(r"\(.+\)", text, re.DOTALL)
    ]
    assert shapeless == []


def test_completion_shows_what_is_public():
    names = {name for name in dir(softgym_mj) if not name.startswith("__")}
    assert names == set(softgym_mj.__all__) - {"__version__"}
    assert all(hasattr(softgym_mj, name) for name in softgym_mj.__all__)
    shown = rlcompleter.Completer({"softgym_mj": softgym_mj}).attr_matches("softgym_mj.")
    assert {match.split(".")[1].rstrip("(") for match in shown} == names


def test_help_says_how_to_begin(capsys):
    help(softgym_mj)
    text = capsys.readouterr().out
    assert "softgym_mj.load(" in text and "suite.load(" in text and "gymnasium.make(" in text
    help(softgym_mj.load)
    text = capsys.readouterr().out
    for argument in inspect.signature(softgym_mj.load).parameters:
        assert f"{argument}:" in text
