"""Start states of the tasks."""
