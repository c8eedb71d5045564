"""`guided`: measures whose reward leads to states from which the performance grows."""

from softgym_mj.metrics import Array, Measures

SHARE = 0.5  # Share of the approach in the reward; the rest is for reaching the goal.


def guided(name: str, performance: Array, approach: Array, info: dict[str, Array]) -> Measures:
    """Returns measures with the reward p + (1 - p) a / 2.

    Args:
        name: name of the first term.
        performance: p (...), from 0 to 1.
        approach: a (...), which grows from 0 at the start to 1 at the goal.
        info: as of `Measures`.
    """
    rewards = {name: performance, "approach": SHARE * (1.0 - performance) * approach}
    return Measures(performance, rewards, info)
