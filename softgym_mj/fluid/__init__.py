"""Particle fluid: the engine plugin and the entity that it simulates."""

from softgym_mj.fluid.water import Liquid, Resolution, Water
from softgym_mj.native.library import load_plugin

__all__ = ["Liquid", "Resolution", "Water", "load_plugin"]
