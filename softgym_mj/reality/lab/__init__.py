"""The lab: sheets of a fabric against theory, without any data."""

from softgym_mj.reality.lab.experiments import BOUNDS, Measurement
from softgym_mj.reality.lab.report import run, write

__all__ = ["BOUNDS", "Measurement", "run", "write"]
