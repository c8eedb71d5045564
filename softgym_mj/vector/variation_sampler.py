"""`VariationSampler`: which variations environments play next, drawn by a generator of each."""

from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium.utils.seeding import np_random

from softgym_mj.envs.resets import draw_variation


class VariationSampler:
    """Generators of environments, by their numbers; who needs to can look one draw ahead.

    Attributes:
        variations: indices that are drawn from.
    """

    def __init__(self, number: int, variations: Sequence[int]):
        """Generators without seeds.

        Args:
            number: of environments.
            variations: indices to draw from.
        """
        self.variations = variations
        self._generators = [np_random()[0] for _ in range(number)]
        # What has been drawn ahead, and the generator's state before.
        self._ahead: dict[int, tuple[int, Mapping[str, Any]]] = {}

    def seed(self, i: int, seed: int) -> None:
        """Gives environment `i` a new generator."""
        self._generators[i], _ = np_random(seed)
        self._ahead.pop(i, None)

    def upcoming(self, i: int) -> int:
        """What `next` is going to return."""
        if i not in self._ahead:
            before = self._generators[i].bit_generator.state
            self._ahead[i] = draw_variation(self._generators[i], self.variations), before
        return self._ahead[i][0]

    def next(self, i: int) -> int:
        """The variation of the next episode of environment `i`."""
        variation = self.upcoming(i)
        del self._ahead[i]
        return variation

    def get_state(self, i: int) -> Mapping[str, Any]:
        """The state of a generator, as of NumPy's."""
        ahead = self._ahead.get(i)
        return self._generators[i].bit_generator.state if ahead is None else ahead[1]

    def set_state(self, i: int, state: Mapping[str, Any]) -> None:
        """Restores what `get_state` returned, or the state of any generator of the kind."""
        self._generators[i].bit_generator.state = state
        self._ahead.pop(i, None)
