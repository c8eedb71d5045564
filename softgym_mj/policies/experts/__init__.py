"""Scripted experts: hand-written policies that see the whole state.

They read positions straight from the task: not baselines to learn against, but evidence that the
actors can solve the tasks. Each writes an episode as a generator of actions; all are
deterministic.
"""

from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts.drop_cloth import DropCloth
from softgym_mj.policies.experts.drop_fold_cloth import DropFoldCloth
from softgym_mj.policies.experts.expert import Expert, OwnExpert, WithExpert
from softgym_mj.policies.experts.fold_cloth import FoldCloth
from softgym_mj.policies.experts.fold_crumpled_cloth import FoldCrumpledCloth
from softgym_mj.policies.experts.pour_water import PourWater, PourWaterAmount
from softgym_mj.policies.experts.rope_configuration import RopeConfiguration
from softgym_mj.policies.experts.spread_cloth import SpreadCloth
from softgym_mj.policies.experts.straighten_rope import StraightenRope
from softgym_mj.policies.experts.transport_water import TransportWater

EXPERTS: dict[str, type[Expert]] = {
    "straighten_rope": StraightenRope,
    "spread_cloth": SpreadCloth,
    "fold_cloth": FoldCloth,
    "fold_crumpled_cloth": FoldCrumpledCloth,
    "drop_cloth": DropCloth,
    "rope_configuration": RopeConfiguration,
    "drop_fold_cloth": DropFoldCloth,
    "transport_water": TransportWater,
    "pour_water": PourWater,
    "pour_water_amount": PourWaterAmount,
}


def make_policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """The expert for the task of an environment.

    Args:
        env: environment with two pickers or arms, or with one actor for the cup; or of a task of
            your own that is `WithExpert`.

    Raises:
        InvalidArgumentError: if the task has no expert.
    """
    if isinstance(env.task, WithExpert):
        return OwnExpert(env)
    if env.name not in EXPERTS:
        raise InvalidArgumentError(
            f"policy='scripted': there is no scripted expert for {env.name}; valid choices: "
            "'random', 'zero', a FILE.pt2 or MODULE:FUNCTION. The class of the task may bring one: "
            "a generator `expert(self)` of the actions of an episode"
        )
    return EXPERTS[env.name](env)
