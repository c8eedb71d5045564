"""`FoldGoal`: a cloth folded in half in a place, the goal of three tasks (facts 3.7)."""

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.tasks.base import Evaluation

DISPLACEMENT_WEIGHT = 1.2  # Facts 3.7.


class FoldGoal:
    """Columns 0 to half of a cloth on top of their mirror columns, these in their places.

    Everything is measured at SoftGym's particles, so it does not depend on the resolution.
    """

    def __init__(self, cloth: Cloth, reference: np.ndarray):
        """Sets the goal.

        Args:
            cloth: the cloth.
            reference: (num_vertices, 3) [m] positions of the unfolded cloth; the second half of the
                columns ought to stay there.
        """
        self._cloth = cloth
        self._reference = cloth.particles(reference)

    def evaluate(self) -> Evaluation:
        """Minus the mean distance of the pairs, and minus 1.2 times the mean displacement [m]."""
        pair, moved = metrics.fold_distances(self._cloth.particles(), self._reference)
        terms = {"pair_distance": -pair, "displacement": -DISPLACEMENT_WEIGHT * moved}
        return Evaluation(
            performance=sum(terms.values()),
            reward_terms=terms,
            measures={"pair_distance": pair, "displacement": moved},
        )
