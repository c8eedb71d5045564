"""Reactive expert of SpreadCloth: lifts the cloth by the corners of a side and lays it down."""

from softgym_mj.metrics import Array, namespace
from softgym_mj.policies.reactive.corner_grasps import EDGES, held_corners, of_a_side
from softgym_mj.policies.reactive.flat_fit import flat_fit
from softgym_mj.policies.reactive.grasps import bounded, parsed
from softgym_mj.policies.reactive.lifting import lifting
from softgym_mj.policies.reactive.mending import mending
from softgym_mj.policies.reactive.motions import actions, either
from softgym_mj.policies.reactive.unrolling import unrolling

HANGING, CARRIED = 0.25, 0.1  # [m] Heights from which one held vertex hangs, or two.


def spread_cloth(observation: Array) -> Array:
    """Returns actions (..., 8) of SpreadCloth for "full", followed by "markov" (..., n).

    Cloth that lies almost flat is mended, unless it hangs from a picker.
    """
    xp = namespace(observation)
    # Distances of many points need more than the 11 bits of fast products of a GPU.
    sheet, hands = parsed(xp.astype(observation, xp.float64))
    corners = held_corners(sheet, hands)
    side = of_a_side(corners[..., 0], corners[..., 1])
    heights = xp.where(hands.holds, hands.places[..., 2], 0.0 * hands.places[..., 2])
    mended, flat = mending(sheet, hands, flat_fit(sheet))
    lays = side & (~flat | (xp.min(heights, axis=-1) > CARRIED))
    mends = flat & (xp.max(heights, axis=-1) <= HANGING)
    laid, lifted = unrolling(sheet, hands), lifting(sheet, hands, corners)
    motions = []
    for i in range(2):
        motion = either(lays, laid[i], either(mends, mended[i], lifted[i]))
        motions.append(motion._replace(goal=bounded(motion.goal, EDGES)))
    return xp.astype(actions(hands.centers, motions), observation.dtype)
