"""The Gymnasium ids; the environment class is imported only when one is made."""

import gymnasium

from softgym_mj.registry import TASKS


def register() -> None:
    """Registers one id per task, for `make` and `make_vec`.

    The time limit is the environment's own `horizon`.
    """
    for record in TASKS.values():
        if record.gymnasium_id not in gymnasium.registry:
            gymnasium.register(
                id=record.gymnasium_id,
                entry_point="softgym_mj.envs.gymnasium_env:SoftGymEnv",
                vector_entry_point="softgym_mj.vector.environment:make_vector_env",
                kwargs={"task": record.name},
            )
