"""Expert of RouteCable: carries the most misplaced vertices over the pegs to their places.

It is the expert of RopeConfiguration, with the route as the shape of the rope.
"""

from softgym_mj.policies.experts import rope_configuration

ARM_CARRY = 0.05  # [m] Height of hands above their lowest position: the rope clears the pegs.


class RouteCable(rope_configuration.RopeConfiguration):
    """Carries up to two vertices to their places, and repeats while the route improves."""

    def _begin(self):
        super()._begin()
        if self._has_arms:
            self._carry = float(self._actor.limits[0][2]) + ARM_CARRY
