"""Which tasks a test plays by default where all of a kind go the same way."""

import pytest

import softgym_mj

ONE_OF_EACH = ("rope_configuration", "fold_cloth", "drop_cloth", "transport_water", "pour_water")


def by_kind(*values):
    """Parameters (task, *values): one task of each kind by default, the others in the long run."""
    return [
        pytest.param(task, *values, marks=() if task in ONE_OF_EACH else pytest.mark.long)
        for task in softgym_mj.TASKS
    ]
