"""Sums of products against NumPy's `einsum` and `interp`."""

import numpy as np
import pytest

from softgym_mj.entities.cloth import Cloth
from softgym_mj.native.arithmetic import interpolate


@pytest.mark.parametrize("axis", (0, 1))
@pytest.mark.parametrize(("number", "nodes"), ((81, 17), (5, 9), (17, 17), (2, 2)))
def test_interpolation_has_the_bits_of_a_sum_over_all_nodes(number, nodes, axis):
    place = np.linspace(0, nodes - 1, number)
    weights = np.maximum(1.0 - np.abs(place[:, None] - np.arange(nodes)), 0.0)
    values = np.random.default_rng(0).normal(size=(nodes, 4, 3)).swapaxes(0, axis)
    sums = "in,nbk->ibk" if axis == 0 else "in,bnk->bik"
    found = interpolate(weights, values, axis)
    np.testing.assert_array_equal(found, np.einsum(sums, weights, values))
    expected = np.interp(place, np.arange(nodes), values.swapaxes(0, axis)[:, 2, 1])
    np.testing.assert_allclose(found.swapaxes(0, axis)[:, 2, 1], expected, atol=1e-12)


def test_weights_of_a_cloth_are_those_of_a_linear_interpolation():
    arrays = Cloth(dims=(96, 58)).arrays
    for name in ("by_row", "by_column"):
        weights = arrays[name]
        places = weights @ np.arange(weights.shape[1])
        np.testing.assert_allclose(weights.sum(axis=1), 1.0)
        np.testing.assert_allclose(places, np.linspace(0, weights.shape[1] - 1, len(weights)))
        assert all(np.ptp(np.flatnonzero(row)) <= 1 for row in weights)
