"""Variations by index: draws and splits against known values."""

import hashlib
import re

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.variations import indices

# ---------------------------------------------------------------- seeds


@pytest.mark.parametrize(
    ("name", "index", "raw", "uniform"),
    [
        (
            "twisted_rope",
            0,
            [17277533539172858437, 11081912795625566404],
            [0.9366169699181189, 0.6007516964156074],
        ),
        (
            "crumpled_cloth",
            999,
            [3851326687854604827, 948634654099081856],
            [0.2087808380961682, 0.051425587643462944],
        ),
    ],
)
def test_known_draws(name, index, raw, uniform):
    assert indices.generator(name, index).bit_generator.random_raw(2).tolist() == raw
    assert indices.generator(name, index).random(2).tolist() == uniform


@pytest.mark.parametrize("index", [0, 1, 17, 999, np.int64(17)])
def test_seed_is_a_hash_of_name_and_index(index):
    digest = hashlib.sha256(b"softgym_mj/some_name/%d" % index).digest()
    seed = sum(byte << (8 * place) for place, byte in enumerate(digest[:16]))
    expected = np.random.default_rng(seed).bit_generator.random_raw(5)
    found = indices.generator("some_name", index).bit_generator.random_raw(5)
    np.testing.assert_array_equal(found, expected)


def test_draws_do_not_depend_on_what_was_drawn_before():
    first = indices.generator("a", 3).random(4)
    np.random.seed(0)  # noqa: NPY002 (the global generator must not matter)
    for index in range(10):
        indices.generator("b", index).random(100)
    np.testing.assert_array_equal(indices.generator("a", 3).random(4), first)


# ---------------------------------------------------------------- splits and indices


def test_splits():
    assert list(indices.split_indices("train")) == list(range(800))
    assert list(indices.split_indices("evaluate")) == list(range(800, 1000))
    assert list(indices.split_indices("all")) == list(range(1000))
    train, evaluate = set(indices.SPLITS["train"]), set(indices.SPLITS["evaluate"])
    assert not train & evaluate
    assert train | evaluate == set(indices.SPLITS["all"])
    for split in ("Train", "", None, 0):
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
