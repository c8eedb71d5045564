"""Fuzz tests of the plugins with invalid models and states (`fuzz_plugins`)."""

import sys

import pytest

from tests.native import fuzz_plugins

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of memory")


def test_no_case_ends_a_process():
    messages = {}
    assert fuzz_plugins.run(0, 250, report=messages.__setitem__) == {}
    # Most are models that compile.
    assert sum(message == "" for message in messages.values()) > 100


@pytest.mark.slow
def test_no_case_ends_a_process_that_looks_for_bad_reads_and_casts(tmp_path):
    assert fuzz_plugins.run(0, 10_000, fuzz_plugins.build(tmp_path)) == {}
