"""Validation of arguments."""

import math
from collections.abc import Sequence

import pytest

from softgym_mj.exceptions import InvalidArgumentError, check_name, check_number
from softgym_mj.validation import check_type


@pytest.mark.parametrize("value", [0.0, 1.5, -1.0, math.nan, math.inf])
def test_a_number_outside_its_limits_is_refused_with_them(value):
    with pytest.raises(InvalidArgumentError) as error:
        check_number("rate", value, gt=0.0, le=1.0)
    assert str(error.value) == f"rate={value} is not valid: expected a number > 0 and <= 1."
    check_number("rate", 1.0, gt=0.0, le=1.0)
    check_number("rate", 0.0, ge=0.0, lt=1.0)


@pytest.mark.parametrize(
    ("value", "hint"),
    [("fold_clothes", " (did you mean 'fold_cloth'?)"), ("kettle", ""), (None, "")],
)
def test_an_unknown_name_lists_the_choices_and_the_most_similar(value, hint):
    with pytest.raises(InvalidArgumentError) as error:
        check_name("task", value, ("fold_cloth", "pour_water"))
    expected = f"task={value!r} is unknown{hint}; valid choices: 'fold_cloth', 'pour_water'."
    assert str(error.value) == expected


@pytest.mark.parametrize(
    ("value", "annotation", "words"),
    [
        (2.5, int | None, "a whole number or None"),
        (128, tuple[int, int], "two whole numbers"),
        (3, str | Sequence[str], "a string or Sequence[str]"),
        ("yes", bool, "True or False"),
    ],
)
def test_a_value_of_another_type_names_the_type_in_words(value, annotation, words):
    with pytest.raises(InvalidArgumentError) as error:
        check_type("size", value, annotation)
    assert str(error.value) == f"size={value!r} is not valid: expected {words}."
