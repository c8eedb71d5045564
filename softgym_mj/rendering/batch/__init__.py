"""Batch renderer: a kernel of the library renders many environments, on a GPU one block each.

Cameras, colors and lights are read from compiled models. Depths and labels equal those of OpenGL
except at the rims of objects; colors are similar.
"""

from softgym_mj.rendering.batch.pictures import Pictures
from softgym_mj.rendering.batch.scenes import Described, describe

__all__ = ["Described", "Pictures", "describe"]
