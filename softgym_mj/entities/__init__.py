"""Parts of a scene: the arena, ropes, cloths, garments, shirts, cups and marks."""

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.cup import Cup, CupSize
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.garment import Garment
from softgym_mj.entities.rope import Rope
from softgym_mj.entities.shirt import Cut, Shirt
from softgym_mj.entities.views import CameraPose, View

__all__ = [
    "Arena",
    "CameraPose",
    "Cloth",
    "Cup",
    "CupSize",
    "Cut",
    "Fabric",
    "Garment",
    "Rope",
    "Shirt",
    "View",
]
