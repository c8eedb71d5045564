"""Reactive experts of PourWater and PourWaterAmount: tilt the cup about its lip, above the target.

The lip is the outer upper edge on the target's side. The upright or tilted cup is always behind it,
so that it does not touch the target.
"""

from typing import NamedTuple

from softgym_mj.metrics import Array, columns, namespace
from softgym_mj.policies.experts.pour_water import CLEARANCE, DRAINED, REACH, STANDOFF
from softgym_mj.tasks.shared.pouring import MAX_STEP
from softgym_mj.tasks.shared.starts.cup_variations import TARGET_WALL, WALL

STEP = [8 * most for most in MAX_STEP]  # [m, m, rad] Largest motion in an env step of 8 sim steps.
HIGHEST = 0.25  # [m] Largest height of the lip above the target's rim.
# [m] Missing height with which the lip still moves over the target, and range in which it stops.
LOW = 0.01, 0.02
# Motion of the lip in an env step: slowest and fastest [m], and per root of the distance from its
# start or to its end [m^0.5].
SLOWEST, FASTEST, ROOT = 0.012, 0.06, 0.12
# [m] Height of the lip above the water during the approach, before the water flows, and distance
# from the target over which it changes.
TRAVEL, READY, NEAR = 0.03, 0.01, 0.1
OVER = 0.02  # [m] Distance of the lip from its place over the target from which water may flow.
# [rad] Largest angles in an env step: before the water flows, while it does, and backwards; angle
# if none flows although some is missing.
TILT, TIP, BACK, CREEP = 0.06, 0.03, -0.12, 0.005
GAIN = 1.5  # [rad/m] Angle in an env step per height of the lip above the water, before it flows,
RESPONSE = 1.2  # [rad] and per height over the cup's, while it flows.
# Height of the water above the lip at full flow, as a fraction of the cup's; it falls to none from
# this missing share of the water on. Small cups still pour a fifth while they turn back.
HEAD, FULL = 0.4, 0.6
# Missing share at which PourWaterAmount stops, and fraction of the full flow that counts as some.
SHORT, ALMOST = 0.02, 0.05
FLOWING = 0.05  # Share of the water in the air from which it flows, twice that of spilled drops.
CUP = 18  # Largest size of an observation without an arm.


class Lip(NamedTuple):
    """Lip of a cup.

    Attributes:
        x, z: its position (...) [m].
        along, up: its distances from the middle of the cup's floor (...) [m].
        theta: angle of the cup (...) [rad].
    """

    x: Array
    z: Array
    along: Array
    up: Array
    theta: Array


def pour_water(observation: Array) -> Array:
    """Returns actions (..., 3) of PourWater for "markov" (..., 16), with an arm (..., n)."""
    return _poured(observation, namespace(observation).ones_like(observation[..., 0]))


def pour_water_amount(observation: Array) -> Array:
    """Returns actions (..., 3) of PourWaterAmount for "markov" (..., 18), with an arm (..., n)."""
    gone, share = 1.0 - observation[..., 12], observation[..., 14]
    return _poured(observation, share - SHORT - gone)


def _in_the_air(observation: Array) -> Array:
    """Returns the share (...) of the water in neither cup."""
    return 1.0 - observation[..., 11] - observation[..., 12]


def _poured(observation: Array, missing: Array) -> Array:
    """Returns actions (..., 3) that pour a missing share (...) of the water."""
    xp = namespace(observation)
    length, _, up, target, rim, inner = (observation[..., k] for k in range(3, 9))
    actual, along = observation[..., :3], length / 2 + WALL
    # Actions displace the commanded pose of an arm, which the cup follows.
    commanded = observation[..., -3:] if observation.shape[-1] > CUP else actual
    x, z, theta = (commanded[..., k] for k in range(3))
    lip, reached = _lip(commanded, along, up), _lip(actual, along, up)
    wall = target - inner / 2 - TARGET_WALL  # Outer face of the target's near wall.
    beside, over = wall - STANDOFF, wall + TARGET_WALL + REACH
    move = _moved(lip, rim, beside, over, over - wall)
    # Water is held back just below the inner edge, or its height above depends on what is missing.
    margin = READY + (TRAVEL - READY) * xp.clip((beside - lip.x) / NEAR, 0.0, 1.0)
    spare = reached.z + WALL * xp.sin(reached.theta) - observation[..., 10] - margin
    held = xp.clip(GAIN * spare, 0.0, TILT)
    flow = xp.clip(missing / FULL, 0.0, 1.0)
    pours = xp.clip(RESPONSE * ((spare + READY * flow) / up + HEAD * flow), BACK, TIP)
    stands = xp.clip(2.0 - 2.0 * _in_the_air(observation) / FLOWING, 0.0, 1.0)
    creeps = xp.maximum(pours, CREEP * xp.clip(flow / ALMOST, 0.0, 1.0))
    # The highest water is elsewhere once the cup is empty.
    pours = xp.where(flow > 0.0, pours + stands * (creeps - pours), xp.clip(pours, None, 0.0))
    ready = xp.clip(1.0 - (over - lip.x) / OVER, 0.0, 1.0)
    tilt = xp.clip(held + ready * (pours - held), -theta, DRAINED - theta)
    angle = theta + tilt
    cosine, sine = xp.cos(angle), xp.sin(angle)
    goal_x = lip.x + move[..., 0] - along * cosine - up * sine
    goal_z = lip.z + move[..., 1] + along * sine - up * cosine
    action = columns((goal_x - x) / STEP[0], (goal_z - z) / STEP[1], tilt / STEP[2])
    return action / xp.clip(xp.max(xp.abs(action), axis=-1), 1.0, None)[..., None]


def _lip(pose: Array, along: Array, up: Array) -> Lip:
    """Returns the lip of a cup at a pose (..., 3) [m, m, rad]."""
    xp, (x, z, theta) = namespace(pose), (pose[..., k] for k in range(3))
    cosine, sine = xp.cos(theta), xp.sin(theta)
    return Lip(x + along * cosine + up * sine, z - along * sine + up * cosine, along, up, theta)


def _moved(lip: Lip, rim: Array, beside: Array, over: Array, depth: Array) -> Array:
    """Returns the motion (..., 2) [m] of the lip: beside the target, then over it.

    Args:
        lip: the lip.
        rim: height of the target (...) [m].
        beside: position along X [m] until the lip is high enough.
        over: position along X [m] over the target.
        depth: distance of that from the outer face of the target's wall [m].
    """
    xp = namespace(lip.x)
    # Height at which the sloping wall of the cup has clearance, with the lip over the target.
    slope = xp.clip(xp.tan(xp.clip(lip.theta, 0.0, 1.5)), 0.01, None)
    needed = rim + CLEARANCE + depth / slope
    share = xp.clip(1.0 - (needed - lip.z - LOW[0]) / LOW[1], 0.0, 1.0)
    started = xp.clip(lip.x - lip.along, 0.0, None) + xp.clip(lip.z - lip.up, 0.0, None)
    left = xp.clip(over - lip.x, 0.0, None)
    pace = xp.clip(ROOT * xp.sqrt(xp.minimum(started, left)), SLOWEST, FASTEST)
    goals = beside + share * (over - beside), xp.minimum(needed, rim + HIGHEST)
    ways = (goal - place for goal, place in zip(goals, (lip.x, lip.z), strict=True))
    return columns(*(xp.clip(way, -pace, pace) for way in ways))
