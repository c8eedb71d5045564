"""Makes steps of a task's worlds by a library in place of the package's.

python -m tests.native.emulated_steps LIBRARY TASK VARIATION STEPS
"""

import ctypes
import itertools
import sys

from softgym_mj.native.places import Processor
from tests.cloth import test_worlds as cloth
from tests.fluid import test_worlds as water

THREADS = 16  # Of a block: two groups of eight lanes.


class _Emulated(Processor):
    """Steps by the functions of a library, of the names of those of the package's."""

    def __init__(self, file):
        super().__init__()
        self._library = ctypes.CDLL(str(file))

    def step(self, kind, batch, num_worlds, size):
        step = getattr(self._library, f"softgym_mj_{kind}_batch_step")
        step(ctypes.c_void_p(self.address(batch)), 1, THREADS)


def step_and_check(file, task, variation, steps):
    """Makes some sim steps from a variation's start; each ends like the plugin's."""
    place = _Emulated(file)
    if "water" in task:
        followed = water._Followed(task, variation)
        worlds = water._worlds([followed], place)
        told = ((poses,) for poses in followed.steps(1))
    else:
        followed = cloth._Followed(task, variation, fidelity="fast")
        worlds = cloth._worlds([cloth._model(followed.env)], place)
        followed.place(worlds, 0)
        told = followed.steps(followed.actions(1, 0))
    for arrays in itertools.islice(told, steps):
        worlds.step(*(array[None] for array in arrays))
        followed.check(worlds, 0)
    assert worlds.flags[0] == 0


if __name__ == "__main__":
    library, name, index, number = sys.argv[1:]
    step_and_check(library, name, int(index), int(number))
