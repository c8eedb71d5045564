"""`ActionSpace`: what the entries of an actor's action are."""

from typing import NamedTuple


class ActionSpace(NamedTuple):
    """The entries of an action, from -1 to 1 each.

    Attributes:
        entries: name, unit ("" for none) and what the ends mean, of each.
        layout: the same in a few words, for messages.
    """

    entries: tuple[tuple[str, str, str], ...]
    layout: str


def gripper_actions(number: int, way: str, ends: str) -> ActionSpace:
    """For each of `number` grippers a way along X, Y and Z, and grip.

    Args:
        number: of grippers.
        way: what comes before the name of an axis.
        ends: what the ends of a way mean.
    """
    entries = []
    for i in range(number):
        entries += [(f"gripper {i}, {way}{axis}", "m", ends) for axis in "xyz"]
        entries.append((f"gripper {i}, grip", "", "above 0 closes, else opens"))
    return ActionSpace(tuple(entries), f"{number} gripper(s) x 4")
