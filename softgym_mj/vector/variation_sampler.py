"""`VariationSampler`: draws the next variation of each environment from its own generator."""

from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium.utils.seeding import np_random

from softgym_mj.envs.resets import draw_variation


class VariationSampler:
    """One random generator per environment, with a look ahead of one draw.

    Attributes:
        variations: Variation indices to draw from.
    """

    def __init__(self, number: int, variations: Sequence[int]):
        """Makes unseeded generators.

        Args:
            number: Number of environments.
            variations: Variation indices to draw from.
        """
        self.variations = variations
        self._generators = [np_random()[0] for _ in range(number)]
        # Variations drawn ahead, each with the generator's state before the draw.
        self._ahead: dict[int, tuple[int, Mapping[str, Any]]] = {}

    def seed(self, i: int, seed: int) -> None:
        """Seeds the generator of environment `i`."""
        self._generators[i], _ = np_random(seed)
        self._ahead.pop(i, None)

    def upcoming(self, i: int) -> int:
        """Returns the variation that `next` will return."""
        if i not in self._ahead:
            before = self._generators[i].bit_generator.state
            self._ahead[i] = draw_variation(self._generators[i], self.variations), before
        return self._ahead[i][0]

    def next(self, i: int) -> int:
        """Returns the variation of the next episode of environment `i`."""
        variation = self.upcoming(i)
        del self._ahead[i]
        return variation

    def get_state(self, i: int) -> Mapping[str, Any]:
        """Returns the state of the generator of environment `i`, in NumPy's format."""
        ahead = self._ahead.get(i)
        return self._generators[i].bit_generator.state if ahead is None else ahead[1]

    def set_state(self, i: int, state: Mapping[str, Any]) -> None:
        """Restores the result of `get_state`, or the state of any generator of this kind."""
        self._generators[i].bit_generator.state = state
        self._ahead.pop(i, None)
