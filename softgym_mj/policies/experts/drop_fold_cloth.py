"""Expert of DropFoldCloth: folds the cloth in the air and drops it.

Pickers regrasp the hanging cloth at the ends of its middle column, one after the other, so that it
hangs folded. They toss it and grasp the ends from outside, where they do not touch the edges. They
move towards +X with trailing edges and stop: the edges swing forward, and the cloth is released
when it is about level. The parameters of the swing come from random search on training variations.
"""

import functools
import itertools
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.picker_expert import CLOSED, OPEN
from softgym_mj.policies.experts.regrasping import RegraspingExpert
from softgym_mj.policies.experts.rehearsing import Plan, RehearsingExpert

# By the largest width [m]: middle and half range of these widths [m], velocities along X in the env
# steps of the swing and along Z in the last ones (fractions of full speed), and their change per
# half range.
BANDS = ((0.56, 0.46, 0.1), (0.76, 0.66, 0.1))
ALONG = (
    (
        (-0.888, -0.67, 1.52, 0.528, 1.1, 1.07, 0.815, 0.671, 0.36, -0.506),
        (0.001, 0.03, -0.026, -0.133, -0.049, -0.124, 0.113, 0.022, 0.014, -0.163),
    ),
    (
        (-1.34, -0.574, 0.405, 0.871, 0.935, 1.12, 1.04, 0.797, 0.219, -0.809),
        (0.042, -0.073, 0.041, 0.136, 0.063, 0.064, -0.006, -0.03, -0.061, 0.01),
    ),
)
UP = (
    ((-0.239, -0.072, -0.042, -0.401), (0.136, 0.221, 0.177, 0.073)),
    ((-0.155, -0.215, 0.02, 0.06), (0.199, -0.014, 0.014, 0.278)),
)
# Distance of the fold during swing and fall [m]: at 0.56 m, and per width and depth [m / m].
CARRY = ((0.259, -0.028, 0.085), (0.213, 0.064, 0.025))
LOWEST = 0.61  # [m] Minimum height of the fold if pickers hold it from 6 cm below.
SPREADING = 0.8  # Fraction of full speed towards the start.
APPROACH, FOLLOW = 0.35, 0.5  # Shares per env step of the remaining distance and the cloth's lag.
CALM, NEAR = 0.06, 0.012  # [m/s] Mean speed and [m] distance at which it counts as at rest.
UNCALM = 0.1  # [m/s] Mean speed at which the cloth counts as at rest before a toss.
OUTSIDE = 0.045  # [m] Target distance of pickers outside of the edges.
FLIPPED = 0.07  # [m] Offset along Y from which a corner counts as hanging over the fold.
SHAKE = (1.0, 1.0, -1.0, -1.0)  # Velocities along Z in env steps, as fractions of full speed.
SWAYING = 0.2  # [m/s] Mean speed above which the cloth is not tossed.
SWINGING = 0.3, 0.15  # [m/s] Speeds up to which a vertex is grasped in place.
PACES = 0.9, 1.0, 1.1  # Candidate speed factors of the swing.
SHIFTS = -0.06, -0.03, 0.0, 0.03, 0.06  # [m] Candidate shifts of the swing's start.
IOU_PRICE, CORNER_PRICE = 0.3, 1.0  # Weights of outline IoU and of corner errors [1/m].
LANDING = 16  # Env steps of swing and fall.
LATEST = 75  # Env step after which the cloth is not regrasped.
CLEARING = 2  # Env steps in which pickers move away from released vertices.
RISE, RISEN = 0.3, 1.0  # Fraction of full speed and height [m] of grippers out of the way.

PLACE = 0.75  # Where arms drop the cloth, as a share of its width: the middle of its far half.
CARRYING, LETTING_DOWN = 0.4, 0.5  # Fractions of full speed.
HURRYING = 0.9  # Fraction of full speed after a failed grasp, when time is short.
CLEARANCE = 0.25  # Extra carrying height over the release height, as a share of the width.
WAITING = 5  # Env steps for the cloth to come to rest.


class DropFoldCloth(RegraspingExpert, RehearsingExpert):
    """Folds the cloth in the air and swings it; arms carry it to its place and drop it from low."""

    def _episode(self) -> Iterator[np.ndarray]:
        cloth, held = self._env.task.cloth, self._actor.held
        columns = cloth.shape[1]
        self._middle = (held // columns * columns + columns // 2).tolist()
        if not self._has_arms:
            while take := self._next_take():
                yield from take()
        yield from self._best_fall()()
        yield from self._away()

    def _next_take(self) -> Plan | None:
        """Returns a plan that changes the grasp if that leads to a better fold, else None."""
        if self._env.step_count >= LATEST or self._actor.held.max() < 0:
            return None
        takes = self._tosses() if self._folded() else self._fetches()
        outcomes = self._outcomes(takes, self._fold)
        stays = self._folded() and self._outcome(self._fall, self._lie) >= outcomes.max()
        return None if stays else takes[outcomes.argmax()]

    def _fetches(self) -> list[Plan]:
        """Returns plans that grasp the ends of the middle column."""
        orders = (0, 1), (1, 0)
        ways = itertools.product(orders, SWINGING)
        fetches: list[Plan] = [
            functools.partial(self._regrasp, self._middle, *way, LATEST) for way in ways
        ]
        if self._speed() >= CALM:
            fetches.append(functools.partial(self._calm, CALM, LATEST))
        return fetches

    def _tosses(self) -> list[Plan]:
        """Returns plans that grasp one or both of these ends from outside."""
        ways = (True, True), (True, False), (False, True)
        return [functools.partial(self._calm_toss, np.array(anew)) for anew in ways]

    def _calm_toss(self, anew: np.ndarray) -> Iterator[np.ndarray]:
        yield from self._calm(UNCALM, LATEST)
        if self._flipped():
            yield from self._shake()
        yield from self._toss(anew)

    def _fold(self) -> Iterator[np.ndarray]:
        """Grasps the ends without rehearsal and drops the cloth."""
        while self._env.step_count < LATEST:
            yield from self._regrasp(self._middle, (0, 1), SWINGING[0], LATEST)
            if not self._folded():
                break
            yield from self._calm(UNCALM, LATEST)
            if flipped := self._flipped():
                yield from self._shake()
            inside = self._outside() < OUTSIDE
            if inside.any() and (flipped or self._speed() < SWAYING):
                yield from self._toss(inside)
            elif not flipped:
                break
        yield from self._fall()
        yield from self._lie()

    def _fall(self) -> Iterator[np.ndarray]:
        yield from self._swing() if self._folded() else self._let_down()

    def _best_fall(self) -> Plan:
        """Returns the plan of swing and fall with the best outcome."""
        if self._has_arms or not self._folded():
            return self._let_down
        ways = itertools.product(PACES, SHIFTS)
        swings = [functools.partial(self._swing, *way) for way in ways]
        outcomes = self._outcomes(swings, self._lie)
        return swings[outcomes.argmax()]

    def _away(self) -> Iterator[np.ndarray]:
        yield from self._move(self._raised(RISEN), OPEN, RISE)

    def _lie(self) -> Iterator[np.ndarray]:
        """Waits for the end of the episode."""
        yield from self._away()
        while True:
            yield self._rest(OPEN)

    def _value(self) -> float:
        # A pile in the right place is no fold.
        info = self._env.task.info()
        lies = IOU_PRICE * info["outline_iou"] - CORNER_PRICE * info["mean_corner_distance"]
        return info["normalized_performance"] + lies

    def _folded(self) -> bool:
        """Returns whether it is held by the ends of its middle column."""
        return self._actor.held.tolist() == self._middle

    def _outside(self) -> np.ndarray:
        """Returns the distances (2,) [m] of pickers outside of the vertices that they hold."""
        held = self._actor.held
        side = np.sign(self._env.task.cloth.flat()[held, 1])
        return side * (self._actor.positions() - self._target.points()[held])[:, 1]

    def _flipped(self) -> bool:
        """Returns whether a corner hangs over the fold."""
        y = self._env.task.cloth.grid()[[0, -1], :, 1]
        return bool(np.abs(y[:, [0, -1]] - y[:, y.shape[1] // 2, None]).max() > FLIPPED)

    def _shake(self) -> Iterator[np.ndarray]:
        """Moves up and down, so that corners slip off the fold."""
        for up in SHAKE:
            yield np.tile([0.0, 0.0, up, 1.0], 2)

    def _speed(self) -> float:
        """Returns mean speed of the cloth [m/s]."""
        return float(np.linalg.norm(self._target.velocities(), axis=1).mean())

    def _velocities(self, pace: float = 1.0) -> np.ndarray:
        """Returns velocities along X and Z (n, 2) in the swing, as fractions of full speed.

        Velocities along X are multiplied by `pace`.
        """
        width = self._env.task.cloth.size[0]
        band = self._band()
        share = (width - BANDS[band][1]) / BANDS[band][2]
        along, up = (np.array(x[band][0]) + share * np.array(x[band][1]) for x in (ALONG, UP))
        up = np.concatenate([np.zeros(len(along) - len(up)), up])
        return np.clip(np.column_stack([pace * along, up]), -1.0, 1.0)

    def _band(self) -> int:
        return int(self._env.task.cloth.size[0] >= BANDS[0][0])

    def _start(self, shift: float = 0.0) -> np.ndarray:
        """Returns the ends of the fold (2, 3) [m] before the swing, moved by `shift` [m]."""
        cloth = self._env.task.cloth
        (width, depth), carry = cloth.size, CARRY[self._band()]
        heights = self._stride * self._velocities()[:, 1].cumsum()
        start = np.zeros((2, 3))
        carried = np.dot(carry, (1.0, width - BANDS[0][0], depth - BANDS[0][0]))
        start[:, 0] = shift + width / 2 - carried
        start[:, 1] = cloth.flat()[self._actor.held, 1]
        start[:, 2] = LOWEST - min(0.0, heights.min())
        return start

    def _calm(self, speed: float, latest: int, shift: float = 0.0) -> Iterator[np.ndarray]:
        """Moves the fold to the start; pickers follow the swinging cloth to damp it."""
        start, held = self._start(shift), self._actor.held.copy()
        most = SPREADING * self._stride
        while self._env.step_count < latest:
            points = self._target.points()
            ways = start - points[held]
            if self._speed() < speed and np.abs(ways).max() < (NEAR if speed == CALM else 1.0):
                return
            ways = np.clip(APPROACH * ways, -most, most)
            lag = points.mean(axis=0) - points[held].mean(axis=0)
            ways += FOLLOW * lag * [1.0, 0.5, 0.0]
            ways = np.clip(ways / self._stride, -1.0, 1.0)
            yield np.column_stack([ways, np.ones(2)]).ravel()

    def _swing(self, pace: float = 1.0, shift: float = 0.0) -> Iterator[np.ndarray]:
        """Swings the folded cloth and releases it."""
        yield from self._calm(CALM, self._env.horizon - LANDING, shift)
        for along, up in self._velocities(pace):
            yield np.tile([along, 0.0, up, 1.0], 2)
        away = self._actor.positions() - self._target.points()[self._actor.held]
        away /= np.linalg.norm(away, axis=1)[:, None]
        for _ in range(CLEARING):
            yield np.column_stack([away, -np.ones(2)]).ravel()

    def _let_down(self) -> Iterator[np.ndarray]:
        """Carries the cloth over its place and drops it from as low as it can."""
        width, held = self._env.task.cloth.size[0], self._actor.held >= 0
        low = self._actor.limits[0]
        goals = self._actor.positions()
        goals[:, 0] = PLACE * width
        if not held.all():
            goals[held, 1] = 0.0
        goals[:, 2] = low[2] + CLEARANCE * width
        carrying = CARRYING if self._has_arms else HURRYING
        yield from self._until_late(self._move(goals, CLOSED, carrying))
        for _ in range(WAITING):
            yield self._rest(CLOSED)
        yield from self._until_late(self._move(self._raised(low[2]), CLOSED, LETTING_DOWN))

    def _until_late(self, actions: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        """Yields actions as long as a cloth that is dropped after them still comes to rest."""
        for action in actions:
            if self._env.step_count >= self._env.horizon - LANDING:
                return
            yield action
