"""Start states: how the episodes of a task begin."""
