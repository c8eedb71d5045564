"""The tasks, one file each; `shared` has what several of them use."""

from softgym_mj.metrics import Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.drop_cloth import DropCloth
from softgym_mj.tasks.drop_fold_cloth import DropFoldCloth
from softgym_mj.tasks.fold_cloth import FoldCloth
from softgym_mj.tasks.fold_crumpled_cloth import FoldCrumpledCloth
from softgym_mj.tasks.fold_shirt import FoldShirt
from softgym_mj.tasks.hang_cloth import HangCloth
from softgym_mj.tasks.pour_water import PourWater
from softgym_mj.tasks.pour_water_amount import PourWaterAmount
from softgym_mj.tasks.rope_configuration import RopeConfiguration
from softgym_mj.tasks.route_cable import RouteCable
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import numbers, point, points
from softgym_mj.tasks.shared.settings import ClothTaskSettings, CupTaskSettings, TaskSettings
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere, mirrored
from softgym_mj.tasks.spread_cloth import SpreadCloth
from softgym_mj.tasks.straighten_rope import StraightenRope
from softgym_mj.tasks.transport_water import TransportWater

__all__ = [
    "ClothTaskSettings",
    "CupTaskSettings",
    "DropCloth",
    "DropFoldCloth",
    "Episode",
    "FoldCloth",
    "FoldCrumpledCloth",
    "FoldShirt",
    "HangCloth",
    "Measures",
    "PourWater",
    "PourWaterAmount",
    "RopeConfiguration",
    "RouteCable",
    "SpreadCloth",
    "State",
    "StraightenRope",
    "Task",
    "TaskSettings",
    "ToolStart",
    "TransportWater",
    "Workspace",
    "anywhere",
    "mirrored",
    "numbers",
    "point",
    "points",
]
