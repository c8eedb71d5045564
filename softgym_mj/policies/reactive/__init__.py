"""Reactive experts: functions of the present observation alone, of one simulation or of a batch.

They label what a learner meets, which experts that rehearse or follow a plan cannot do. Arrays are
NumPy's or PyTorch's.
"""

from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array
from softgym_mj.policies.reactive.rope import rope_configuration

LABELS: dict[str, Callable[[Array], Array]] = {"rope_configuration": rope_configuration}


def policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """Returns the reactive expert of an environment that observes "markov".

    Raises:
        InvalidArgumentError: for a task without a reactive expert.
    """
    check_name("task", env.name, LABELS)
    return lambda timestep: LABELS[env.name](timestep.observation["markov"])
