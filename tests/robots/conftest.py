"""What tests of arms in batches share."""

import pytest


@pytest.fixture(name="double_precision")
def _double_precision():
    """JAX computes with 64 bits."""
    import jax

    with jax.enable_x64(True):
        yield
