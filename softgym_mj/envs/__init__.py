"""Environments: a task as an environment of dm_control, dm_control's suite and Gymnasium."""
