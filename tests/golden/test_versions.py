"""Golden episodes do not change without a decision on the version of their task."""

import hashlib
import json

import pytest

from softgym_mj import registry
from tests.golden import episodes

# Version and digest of the golden episodes. Where the digest is another one, CONTRIBUTING.md ("When
# numbers change") says whether `registry.VERSIONS` has to be raised; then both are written here.
DECIDED = {
    "drop_cloth": (0, "7c29a7fae9e6e38f"),
    "drop_fold_cloth": (0, "9db4098a4fa9902f"),
    "fold_cloth": (0, "8707fdeb00d3b61c"),
    "fold_crumpled_cloth": (0, "2524050353bca4e9"),
    "fold_shirt": (0, "b7420b79803c9490"),
    "hang_cloth": (0, "04a93e88eaccdaab"),
    "pour_water": (0, "9aba42f7128177b4"),
    "pour_water_amount": (0, "a47571c959f808c9"),
    "rope_configuration": (0, "ce5fbeae3c1747dc"),
    "route_cable": (0, "c3236f9becd92d41"),
    "spread_cloth": (0, "b15c2a6125fdc202"),
    "straighten_rope": (0, "bcb0fc4723ebe12e"),
    "transport_water": (0, "2d229489293bd47e"),
}


def digest(task):
    """Of all golden episodes of a task."""
    golden = json.loads(episodes.PATH.read_text())
    own = {name: value for name, value in golden.items() if name.split()[0] == task}
    return hashlib.sha256(json.dumps(own, sort_keys=True).encode()).hexdigest()[:16]


@pytest.mark.parametrize(
    "task", [n for n, record in registry.TASKS.items() if not record.is_custom]
)
def test_the_version_was_decided_for_these_episodes(task):
    assert (registry.TASKS[task].version, digest(task)) == DECIDED[task]


def test_versions_are_of_tasks():
    assert set(registry.VERSIONS) <= set(registry.TASKS) and set(DECIDED) <= set(registry.TASKS)
