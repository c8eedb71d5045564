"""Environments: a task as an environment of dm_control, dm_control's suite and Gymnasium."""

import importlib.util

from softgym_mj.exceptions import UnavailableError

if importlib.util.find_spec("dm_control") is None:
    raise UnavailableError(
        "dm_control is missing: `pip install --no-deps 'dm-control>=1.0.50,<1.1'`. On Python 3.13 "
        "and 3.14 it is installed by this command of its own, because labmaze, which softgym_mj "
        "does not use, has no wheels there."
    )
