"""Reactive experts: functions of the present observation alone, of one simulation or of a batch.

They label what a learner meets, which experts that rehearse or follow a plan cannot do. Arrays are
NumPy's or PyTorch's. The attribute `observes` of a function names the observation that it takes,
"markov" without it; "+" joins several, whose numbers follow each other.
"""

from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.metrics import Array
from softgym_mj.policies.reactive.cloth import fold_crumpled_cloth
from softgym_mj.policies.reactive.drop import drop_fold_cloth
from softgym_mj.policies.reactive.folding import fold_cloth
from softgym_mj.policies.reactive.pouring import pour_water, pour_water_amount
from softgym_mj.policies.reactive.rope import rope_configuration
from softgym_mj.policies.reactive.shirt import fold_shirt
from softgym_mj.policies.reactive.spreading import spread_cloth
from softgym_mj.policies.reactive.straightening import straighten_rope
from softgym_mj.robots.gripper import Gripper

LABELS: dict[str, Callable[[Array], Array]] = {
    "drop_fold_cloth": drop_fold_cloth,
    "fold_cloth": fold_cloth,
    "fold_crumpled_cloth": fold_crumpled_cloth,
    "fold_shirt": fold_shirt,
    "pour_water": pour_water,
    "pour_water_amount": pour_water_amount,
    "rope_configuration": rope_configuration,
    "spread_cloth": spread_cloth,
    "straighten_rope": straighten_rope,
}
vars(drop_fold_cloth)["observes"] = "key_points+markov"
vars(fold_crumpled_cloth)["observes"] = "full+markov"
vars(spread_cloth)["observes"] = "full+markov"


def make_policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """Returns the reactive expert of an environment, for any observations.

    Raises:
        InvalidArgumentError: for a task without a reactive expert, an actor of pick and place, or
            arms that act by joints; the policy raises it for arms that its expert does not move.
    """
    check_name("task", env.name, LABELS)
    actor = env.task.actor
    if actor.sim_steps is not None:
        raise InvalidArgumentError("actor", actor.name, "one whose env steps have equal lengths")
    if isinstance(actor, Gripper) and not actor.displaces:
        valid = "an actor whose actions are displacements of grippers"
        raise InvalidArgumentError("actor", actor.name, valid)
    labels = LABELS[env.name]
    names = getattr(labels, "observes", "markov").split("+")
    return lambda timestep: labels(np.concatenate([env.task.observe(name) for name in names]))
