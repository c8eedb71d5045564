"""Particle fluid: the engine plugin and the entity that it simulates."""

from softgym_mj.fluid.library import load_plugin
from softgym_mj.fluid.water import Liquid, Resolution, Water

__all__ = ["Liquid", "Resolution", "Water", "load_plugin"]
