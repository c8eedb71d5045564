"""Evaluation as in the paper: normalized performance at the last step of evaluation variations."""

from softgym_mj.evaluation.configuration import POLICIES, PROTOCOL, Configuration, Planning
from softgym_mj.evaluation.running import Progress, evaluate
from softgym_mj.evaluation.statistics import summary
from softgym_mj.variations.indices import evaluation_variations

__all__ = [
    "POLICIES",
    "PROTOCOL",
    "Configuration",
    "Planning",
    "Progress",
    "evaluate",
    "evaluation_variations",
    "summary",
]
