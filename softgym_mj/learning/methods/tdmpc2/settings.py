"""`TDMPC2Settings`: settings of TD-MPC2."""

import dataclasses

from softgym_mj.exceptions import check_count, check_name, check_number
from softgym_mj.learning.methods.tdmpc2.mppi import MPPISettings
from softgym_mj.learning.methods.tdmpc2.networks import WorldModelSettings
from softgym_mj.validation import typed

PLANS = ("always", "evaluation", "never")


@typed
@dataclasses.dataclass(frozen=True)
class TDMPC2Settings(WorldModelSettings, MPPISettings):
    """Settings of TD-MPC2, besides sizes and planner; the defaults are the published ones.

    Attributes:
        plans: When actions are planned, one of `PLANS`; otherwise the policy prior acts.
        random_steps: Env steps of each seed with random actions before learning starts.
        pretraining: Number of updates before all others.
        updates: Updates per vector step.
        batch: Sequences of each seed in an update.
        replay: Capacity of the replay buffer in env steps of each seed.
        rate: Learning rate of Adam.
        encoder_rate: Learning rate of the encoder.
        largest_gradient: Maximum gradient norm of a seed.
        tau: Polyak coefficient of target critics.
        rho: Decay of losses per env step of a sequence.
        consistency, reward, value: Weights of the model's losses.
        entropy: Weight of the policy's entropy.

    Raises:
        InvalidArgumentError: for a value out of range.
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
