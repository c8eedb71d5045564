"""Checks of arguments at the border."""

import math

import pytest

from softgym_mj.exceptions import InvalidArgumentError, check_number


@pytest.mark.parametrize("value", [0.0, 1.5, -1.0, math.nan, math.inf])
def test_a_number_outside_its_limits_is_refused_with_them(value):
    with pytest.raises(InvalidArgumentError) as error:
        check_number("rate", value, gt=0.0, le=1.0)
    assert str(error.value) == f"rate={value} is not valid: expected a number > 0 and <= 1."
    check_number("rate", 1.0, gt=0.0, le=1.0)
    check_number("rate", 0.0, ge=0.0, lt=1.0)
