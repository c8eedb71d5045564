"""`StoredTask`: a task whose initial states are kept, as they take simulation to come about."""

import abc

import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.robots.base import Actor
from softgym_mj.tasks.shared.base import DeformableTask
from softgym_mj.variations.store import VariationStore


class StoredTask(DeformableTask):
    """A task on one flex or on water that starts from a stored state."""

    def __init__(self, arena: Arena, actor: Actor, store: VariationStore, **settings):
        """Wires the parts together.

        Args:
            arena: the scene, with everything in it.
            actor: what acts.
            store: the initial states.
            **settings: as in `DeformableTask`.
        """
        self._store = store
        self._stored: np.ndarray | None = None
        super().__init__(arena, actor, **settings)

    @property
    def store(self) -> VariationStore:
        """Where the initial states come from."""
        return self._store

    @abc.abstractmethod
    def start(self, state: np.ndarray) -> None:
        """Puts everything where the episode starts; `state` (n, 3) [m] is as stored."""

    def begin(self) -> None:
        self._stored = self._store.load(self.variation)
        self.start(self._stored)

    def after_compile(self, physics, random_state):
        super().after_compile(physics, random_state)
        self._stored = None

    def start_points(self) -> dict[str, np.ndarray]:
        # As stored: what is read back from the model differs in the last bit.
        points = super().start_points()
        return points if self._stored is None else dict.fromkeys(points, self._stored)
