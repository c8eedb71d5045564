"""Environments: a task as dm_control, dm_control's suite and Gymnasium see it."""
