"""Shared fixtures: a cache folder kept between runs, so that cloths are simulated once."""

import os
import pathlib

# Before anything imports dm_control.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SOFTGYM_MJ_CACHE", str(pathlib.Path(__file__).parent.parent / ".test_cache"))
import softgym_mj  # noqa: F401  (chooses the OpenGL backend)
