"""Golden episodes do not change without a decision on the version of their task."""

import hashlib
import json

import pytest

from softgym_mj import registry
from tests.golden import episodes

# Version and digest of the golden episodes. Where the digest is another one, CONTRIBUTING.md ("When
# numbers change") says whether `registry.VERSIONS` has to be raised; then both are written here.
DECIDED = {
    "drop_cloth": (0, "e0106884eb9e314b"),
    "drop_fold_cloth": (0, "e53e97f1d388281c"),
    "fold_cloth": (0, "376067788543c0a7"),
    "fold_crumpled_cloth": (0, "613176afd6ba9367"),
    "fold_shirt": (0, "a1f951227f74f297"),
    "hang_cloth": (0, "1a5a06998b59e2a0"),
    "pour_water": (0, "f03480eb908d4337"),
    "pour_water_amount": (0, "5e74ac0f0e7f04a0"),
    "rope_configuration": (0, "e523e605e8ac278a"),
    "route_cable": (0, "92e50895276d8549"),
    "spread_cloth": (0, "f9cea3dfdf751f0c"),
    "straighten_rope": (0, "56d57d3bc6dd58de"),
    "transport_water": (0, "c8ddae9e1dd7ca70"),
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
