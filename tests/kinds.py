"""Which tasks a test plays by default where all of a kind go the same way."""

import pytest

import softgym_mj

KINDS = ("rope_configuration", "fold_cloth", "drop_cloth", "transport_water", "pour_water")
MATERIALS = ("rope_configuration", "fold_cloth", "pour_water")


def by_kind(*values, of=KINDS):
    """Parameters (task, *values): one task of each kind by default, the others in the long run."""
    return [
        pytest.param(task, *values, marks=() if task in of else pytest.mark.long)
        for task in softgym_mj.TASKS
    ]


def by_material(*values):
    """Parameters (task, *values): rope, cloth and water by default, all in the long run."""
    return by_kind(*values, of=MATERIALS)
