"""Makes steps of a task's worlds by a library in place of the package's.

python -m tests.native.emulated_steps LIBRARY TASK VARIATION STEPS
"""

import ctypes
import itertools
import sys

from tests.cloth import test_worlds as cloth
from tests.fluid import test_worlds as water

THREADS = 16  # Of a block: two groups of eight lanes.


class _Emulated:
    """The library, but for the steps of batches."""

    def __init__(self, library, emulated):
        self._library = library
        for name in ("softgym_mj_cloth_batch_step", "softgym_mj_fluid_batch_step"):
            setattr(self, name, getattr(emulated, name))

    def __getattr__(self, name):
        return getattr(self._library, name)


def step_and_check(file, task, variation, steps):
    """Makes some sim steps from a variation's start; each ends like the plugin's."""
    emulated = ctypes.CDLL(str(file))
    if "water" in task:
        followed = water._Followed(task, variation)
        worlds = water._worlds([followed], turns=THREADS)
        told = ((poses,) for poses in followed.steps(1))
    else:
        followed = cloth._Followed(task, variation, fidelity="fast")
        worlds = cloth._worlds([cloth._model(followed.env)], turns=THREADS)
        followed.place(worlds, 0)
        told = followed.steps(followed.actions(1, 0))
    worlds._library = _Emulated(worlds._library, emulated)
    for arrays in itertools.islice(told, steps):
        worlds.step(*(array[None] for array in arrays))
        followed.check(worlds, 0)
    assert worlds.flags[0] == 0


if __name__ == "__main__":
    library, name, index, number = sys.argv[1:]
    step_and_check(library, name, int(index), int(number))
