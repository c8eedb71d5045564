"""`TDMPC2Settings`: how TD-MPC2 learns and plans."""

import dataclasses

from softgym_mj.exceptions import check_count, check_name, check_number
from softgym_mj.learning.methods.tdmpc2.mppi import MPPISettings
from softgym_mj.learning.methods.tdmpc2.networks import WorldModelSettings
from softgym_mj.validation import typed

PLANS = ("always", "evaluation", "never")


@typed
@dataclasses.dataclass(frozen=True)
class TDMPC2Settings(WorldModelSettings, MPPISettings):
    """How it learns; the defaults are the published ones. See also `MPPISettings`.

    Attributes:
        plans: when it acts by its planner, one of `PLANS`; else by the policy prior.
        random_steps: env steps of each seed that are random, before it learns.
        pretraining: updates before all others.
        updates: for each step of all environments.
        batch: stretches of an update, of each seed.
        replay: env steps of each seed that are kept.
        rate: of Adam.
        encoder_rate: of Adam, of the encoder.
        largest_gradient: norm to which gradients are cut, of each seed.
        tau: share of the critics in their targets, at each update.
        rho: factor to losses, by each env step into the future.
        consistency, reward, value: weights of the model's losses.
        entropy: weight of the policy's entropy.

    Raises:
        InvalidArgumentError: for numbers out of range.
    """

    plans: str = "always"
    random_steps: int = 1_000
    pretraining: int = 1_000
    updates: int = 1
    batch: int = 256
    replay: int = 1_000_000
    rate: float = 3e-4
    encoder_rate: float = 9e-5
    largest_gradient: float = 20.0
    tau: float = 0.01
    rho: float = 0.5
    consistency: float = 20.0
    reward: float = 0.1
    value: float = 0.1
    entropy: float = 1e-4

    def __post_init__(self):
        WorldModelSettings.__post_init__(self)
        MPPISettings.__post_init__(self)
        check_name("plans", self.plans, PLANS)
        for name in ("updates", "batch", "replay"):
            check_count(name, getattr(self, name), 1)
        for name in ("random_steps", "pretraining"):
            check_count(name, getattr(self, name), 0)
        for name in ("rate", "encoder_rate", "tau", "rho"):
            check_number(name, getattr(self, name), gt=0.0, le=1.0)
        for name in ("consistency", "reward", "value", "entropy"):
            check_number(name, getattr(self, name), ge=0.0)
        check_number("largest_gradient", self.largest_gradient, gt=0.0)
