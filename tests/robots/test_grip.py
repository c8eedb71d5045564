"""SoftGym's picker rules as array functions, against loops over plain numbers."""

import numpy as np
import pytest
import torch

from softgym_mj.robots.grip import (
    NONE,
    SLIPPED,
    GripCommand,
    GripLimits,
    GripState,
    kept_in_order,
    step_grips,
)

ENVS, GRIPPERS, VERTICES, STEPS = 64, 3, 24, 40
LOW, HIGH, REACH = 0.125, 0.875, 0.25


def slow(state, command, points, present) -> GripState:
    """The rules one by one, for one simulation."""
    center, held, offset, dropped = (np.array(part).tolist() for part in state)
    for i, closed in enumerate(command.closed):
        if not closed:
            dropped += held[i] >= 0
            held[i] = NONE
    before = [list(point) for point in center]
    for i, way in enumerate(command.displacement.tolist()):
        center[i] = [max(min(c + w, HIGH), LOW) for c, w in zip(center[i], way, strict=True)]
    for i, closed in enumerate(command.closed):
        if not closed or held[i] != NONE:
            continue
        shortest = np.nextafter(REACH**2, 1.0)
        for vertex in range(VERTICES):
            x, y, z = (p - c for p, c in zip(points[vertex].tolist(), before[i], strict=True))
            if present[vertex] and vertex not in held[:i] + held[i + 1 :]:
                distance = x * x + y * y + z * z
                if distance < shortest:
                    shortest, held[i], offset[i] = distance, vertex, [x, y, z]
    return GripState(*map(np.array, (center, held, offset, dropped)))


def steps():
    """Random commands and vertices; those of every other simulation lie on a lattice: they tie."""
    random = np.random.default_rng(0)
    on_lattice = np.arange(ENVS) % 2 == 0
    for _ in range(STEPS):
        ways = random.uniform(-0.2, 0.2, (ENVS, GRIPPERS, 3))
        points = random.uniform(0.0, 1.0, (ENVS, VERTICES, 3))
        for array in (ways, points):
            array[on_lattice] = np.round(8 * array[on_lattice]) / 8
        closed = random.random((ENVS, GRIPPERS)) < 0.7
        slipped = random.random((ENVS, GRIPPERS)) < 0.05
        yield GripCommand(ways, closed), points, random.random((ENVS, VERTICES)) < 0.9, slipped


def start(*leading: int) -> GripState:
    shape = (*leading, GRIPPERS)
    middle, zeros = np.full((*shape, 3), 0.5), np.zeros((*shape, 3))
    return GripState(middle, np.full(shape, NONE), zeros, np.zeros(leading, int))


def limits(*leading: int) -> GripLimits:
    shape = (*leading, GRIPPERS, 3)
    return GripLimits(np.full(shape, LOW), np.full(shape, HIGH), REACH)


def equal(found: GripState, expected: GripState) -> None:
    for name, one, other in zip(GripState._fields, found, expected, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


@pytest.mark.parametrize("convert", [np.asarray, torch.as_tensor], ids=["numpy", "torch"])
def test_a_batch_follows_the_rules(convert):
    state = start(ENVS)
    low, high, reach = limits(ENVS)
    bounds = GripLimits(convert(low), convert(high), reach)
    taken = contended = 0
    for command, points, present, slipped in steps():
        ways, closed = map(convert, command)
        held = convert(points)
        found = step_grips(
            GripState(*map(convert, state)),
            GripCommand(ways, closed),
            lambda centers, held=held: held[..., None, :, :] - centers[..., None, :],
            convert(present),
            bounds,
        )
        each = [
            slow([p[i] for p in state], GripCommand(*(c[i] for c in command)), *where)
            for i, where in enumerate(zip(points, present, strict=True))
        ]
        expected = GripState(*map(np.stack, zip(*each, strict=True)))
        equal(found, expected)
        new = (expected.held >= 0) & (state.held < 0)
        taken += np.count_nonzero(new)
        gaps = points[:, None] - state.center[:, :, None]
        nearest = np.where(present[:, None], (gaps**2).sum(-1), np.inf).argmin(-1)
        contended += np.count_nonzero(new & (expected.held != nearest))
        expected.held[slipped] = SLIPPED
        state = expected
    assert taken > 1000 and contended > 50 and state.dropped.min() > 0


def test_one_simulation_follows_the_rules():
    state = start()
    for commands, clouds, _, slipped in steps():
        command, points = GripCommand(*(c[0] for c in commands)), clouds[0]
        seen: list[np.ndarray] = []

        def offsets(centers, points=points, seen=seen):
            seen.append(centers)
            return points - centers[..., None, :]

        before = [np.array(part) for part in state]
        found = step_grips(state, command, offsets, None, limits())
        equal(GripState(*before), state)  # It changes no argument.
        expected = slow(state, command, points, np.ones(VERTICES, bool))
        equal(found, expected)
        # It looks for vertices only if some gripper closes that holds nothing.
        assert bool(seen) == bool(np.any(command.closed & (state.held == NONE)))
        state = found._replace(held=np.where(slipped[0], SLIPPED, found.held))


def slow_order(holds, distances, gaps) -> list[bool]:
    """Returns which holds stay, one by one: each near enough to all earlier ones that stay."""
    stay: list[int] = []
    for i, holding in enumerate(holds):
        if holding and all(distances[i, j] <= gaps[i, j] for j in stay):
            stay.append(i)
    return [i in stay for i in range(len(holds))]


def test_later_holds_are_released_before_earlier_ones():
    """The rule holds for one simulation, and for a batch."""
    random = np.random.default_rng(0)
    number = 5
    holds = random.random((ENVS, number)) < 0.8
    distances, gaps = random.random((2, ENVS, number, number))
    distances[0], gaps[0] = 1.0, 1.0  # As far as allowed.
    expected = [slow_order(*each) for each in zip(holds, distances, gaps, strict=True)]
    assert not np.array_equal(expected, holds) and np.array(expected).sum() > ENVS
    one_by_one = [
        kept_in_order(
            own.tolist(), lambda i, j, d=d: float(d[j, i]), lambda i, j, g=g: float(g[j, i])
        )
        for own, d, g in zip(holds, distances, gaps, strict=True)
    ]
    assert one_by_one == expected
    for convert in (np.asarray, torch.as_tensor):
        apart, allowed = convert(distances), convert(gaps)
        kept = kept_in_order(
            [convert(holds[:, i].copy()) for i in range(number)],
            lambda i, j, apart=apart: apart[:, j, i],
            lambda i, j, allowed=allowed: allowed[:, j, i],
            lambda mask: True,
        )
        np.testing.assert_array_equal(np.stack([np.asarray(one) for one in kept], 1), expected)
