"""Pictures of many environments at once, by a kernel of the library: on a GPU a block draws each.

What is drawn is read off compiled models, so that it has their cameras, colours and lights.
Distances and labels are those of OpenGL's pictures but for the rims of things; colours are alike.
"""

from softgym_mj.rendering.batch.pictures import Pictures
from softgym_mj.rendering.batch.scenes import Described, describe

__all__ = ["Described", "Pictures", "describe"]
