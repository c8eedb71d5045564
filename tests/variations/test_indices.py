"""Variations by index: seeds and splits."""

import hashlib
import re

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.variations import indices

# ---------------------------------------------------------------- seeds


@pytest.mark.parametrize("index", [0, 1, 17, 999, np.int64(17)])
def test_seed_is_a_hash_of_name_and_index(index):
    digest = hashlib.sha256(b"softgym_mj/some_name/%d" % index).digest()
    seed = sum(byte << (8 * place) for place, byte in enumerate(digest[:16]))
    expected = np.random.default_rng(seed).bit_generator.random_raw(5)
    found = indices.generator("some_name", index).bit_generator.random_raw(5)
    np.testing.assert_array_equal(found, expected)


# ---------------------------------------------------------------- splits and indices


def test_splits():
    assert list(indices.split_indices("train")) == list(range(800))
    assert list(indices.split_indices("evaluate")) == list(range(800, 1000))
    assert list(indices.split_indices("all")) == list(range(1000))
    train, evaluate = set(indices.SPLITS["train"]), set(indices.SPLITS["evaluate"])
    assert not train & evaluate
    assert train | evaluate == set(indices.SPLITS["all"])
    assert list(indices.split_indices(np.array([3, 900]))) == [3, 900]
    for split in ([3, 4, 3], np.array([5, 5]), ()):
        with pytest.raises(InvalidArgumentError, match=r"split=.*each of them once"):
            indices.split_indices(split)
    for split in ("Train", "", None, 0, np.array(3)):
        with pytest.raises(InvalidArgumentError, match=r"split=.*'train', 'evaluate', 'all'"):
            indices.split_indices(split)
    assert indices.evaluation_variations(2) == (800, 801)
    assert indices.evaluation_variations(800, "train") == tuple(range(800))
    for number in (0, 201):
        with pytest.raises(InvalidArgumentError, match=rf"episodes={number} .*1\.\.200"):
            indices.evaluation_variations(number)


@pytest.mark.parametrize("index", [0, 999, np.int32(5), np.uint8(200)], ids=repr)
def test_good_variations(index):
    checked = indices.check_variation(index)
    assert type(checked) is int
    assert checked == index


@pytest.mark.parametrize(
    "index", [-1, 1000, 3.0, np.float64(3), True, np.True_, "3", None, [3]], ids=repr
)
def test_bad_variations(index):
    message = re.escape(f"variation={index!r} ") + r".*0\.\.999"
    for check in (indices.check_variation, lambda index: indices.generator("a", index)):
        with pytest.raises(InvalidArgumentError, match=message):
            check(index)
