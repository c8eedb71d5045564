"""Scripted motions of one-handed arms that pinch a cloth by its edge."""

import numpy as np

from softgym_mj.envs.environment import Environment

VARIATIONS = range(800, 810)
ENV_STEP = 0.08  # [s]
FAR, NEAR = 0.65, 0.4  # [m] From an arm's base, within which it reaches well.
BEYOND = 0.012  # [m] From the middle between the pads to the edge that they straddle.
CLOSING = 10  # Env steps in which the widest fingers close for certain.


def go(
    env: Environment, goals: np.ndarray, closed: bool, speed: float = 0.6, steps: int = 60
) -> None:
    """Moves the commanded points to `goals` (n, 3) [m], at up to `speed` [m/s] along each axis."""
    actor = env.task.actor
    for _ in range(steps):
        way = (goals - actor.commanded_positions()) / ENV_STEP
        way *= speed / max(np.abs(way).max(), speed)
        env.step(np.column_stack([way, np.full(len(way), 1.0 if closed else -1.0)]).ravel())
        if np.abs(actor.positions() - goals).max() < 0.002:
            return


def wait(env: Environment, closed: bool, steps: int) -> None:
    """Stands still for env steps."""
    for _ in range(steps):
        env.step(np.tile([0.0, 0.0, 0.0, 1.0 if closed else -1.0], env.task.actor.num_grippers))


def close_at(env: Environment, place: np.ndarray) -> None:
    """Comes down at `place` (2,) [m] with open fingers and closes them."""
    go(env, np.array([*place, 0.15]), False, 0.6)
    go(env, np.array([*place, env.task.actor.limits[0][2]]), False, 0.2)
    wait(env, True, CLOSING)


def lift_and_carry(env: Environment) -> None:
    """Lifts what is pinched by 0.2 m and carries it by 0.3 m towards the middle."""
    at = env.task.actor.commanded_positions()[0]
    up = at + [0.0, 0.0, 0.2]
    go(env, up, True, 0.3)
    go(env, up + [-np.copysign(0.3, at[0]), 0.0, 0.0], True, 0.6)


def edge_place(env: Environment) -> np.ndarray:
    """Where the tool has to come down (2,) [m], to straddle the edge that is best across X."""
    grid = env.task.cloth.grid()[:, :, :2]
    base = np.array(env.task.actor.mounts[0].base[:2])
    choices = []
    for edge in (grid[:, 0], grid[:, -1], grid[0], grid[-1]):
        along = edge[-1] - edge[0]
        inward = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        inward *= np.sign(inward @ (grid.mean(axis=(0, 1)) - edge.mean(axis=0)))
        for i, vertex in enumerate(edge[2:-2], 2):
            distance = np.linalg.norm(vertex - base)
            outside = max(0.0, distance - FAR, NEAR - distance)
            off_middle = abs(i / (len(edge) - 1) - 0.5)
            score = abs(inward[0]) - 2.0 * outside - 0.2 * off_middle
            choices.append((score, vertex + [np.sign(inward[0]) * BEYOND, 0.0]))
    return max(choices, key=lambda choice: choice[0])[1]
