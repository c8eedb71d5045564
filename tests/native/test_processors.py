"""Bit-identical episodes under other kernels of BLAS, NumPy and the plugins."""

import pytest

from tests.native.portability import KERNELS, cases, digests

FEW = [
    ("straighten_rope", "picker", "scripted"),
    ("drop_cloth", "picker", "scripted"),  # Piles take long: `test_state` has one.
    ("fold_cloth", "franka", "scripted"),
    ("straighten_rope", "sawyer", "scripted"),
    ("pour_water", "cup", "scripted"),
    ("straighten_rope", "picker", "icem"),
]
SOME = ("OpenBLAS for Haswell", "none of these")


@pytest.mark.parametrize(
    ("played", "longest", "kernels"),
    [
        pytest.param(FEW, 10, SOME, marks=pytest.mark.long),
        pytest.param(cases(), 40, KERNELS, marks=pytest.mark.slow),
    ],
    ids=["few", "all"],
)
def test_episodes_are_bit_equal_on_other_processors(played, longest, kernels):
    expected = digests(KERNELS["usual"], played, longest)
    assert len(expected) == len(played)
    for name in kernels:
        assert digests(KERNELS[name], played, longest) == expected, name
