"""Lab: experiments with sheets of a fabric compared with theory, without any data."""

from softgym_mj.reality.lab.experiments import BOUNDS, Measurement
from softgym_mj.reality.lab.report import run, write

__all__ = ["BOUNDS", "Measurement", "run", "write"]
