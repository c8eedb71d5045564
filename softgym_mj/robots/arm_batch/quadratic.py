"""`minimize`: strictly convex quadratic programs of a few variables, by a dual active-set method.

Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic programs
(1983). The solution starts without constraints; in each iteration the most violated one is added,
and those with negative multipliers are dropped.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

MOST = 64  # Largest number of iterations; 10 to 20 are usual with many active joint limits.
TOLERANCE = 1e-9  # Largest violation of a constraint, in the units of the bounds.
DEPENDENT = 1e-12  # Squared share outside the span of others, below which a row depends on them.


class Solution(NamedTuple):
    """Result of a quadratic program.

    Attributes:
        point: minimum (n,).
        found: whether it satisfies all constraints.
        iterations: number of iterations.
    """

    point: jax.Array
    found: jax.Array
    iterations: jax.Array


class _State(NamedTuple):
    point: jax.Array  # (n,), scaled so that the objective is half the squared distance.
    active: jax.Array  # (n,) Indices of active constraints; -1 in free places.
    forces: jax.Array  # (n,) Their multipliers.
    entering: jax.Array  # Index of the constraint that is being added; -1 for none.
    force: jax.Array  # Its multiplier.
    done: jax.Array
    found: jax.Array
    iterations: jax.Array


def minimize(matrix: jax.Array, vector: jax.Array, rows: jax.Array, bounds: jax.Array) -> Solution:
    """Minimizes x M x / 2 + v x subject to R x <= b.

    Args:
        matrix: M (n, n), positive definite.
        vector: v (n,).
        rows: R (m, n).
        bounds: b (m,); infinite for rows that do not count.
    """
    number = len(vector)
    factor = jnp.linalg.cholesky(matrix)

    def solve(right, transposed=False):
        return jax.scipy.linalg.solve_triangular(
            factor, right, lower=True, trans=1 if transposed else 0
        )

    scaled = solve(rows.T).T
    limits = jnp.where(jnp.isfinite(bounds), bounds, jnp.finfo(bounds.dtype).max)
    zero = jnp.zeros((), vector.dtype)
    start = _State(
        point=-solve(vector),
        active=jnp.full(number, -1),
        forces=jnp.zeros_like(vector),
        entering=jnp.array(-1),
        force=zero,
        done=jnp.array(False),
        found=jnp.array(False),
        iterations=jnp.array(0),
    )

    def advance(state: _State) -> _State:
        violation = (scaled * state.point).sum(-1) - limits
        fresh = state.entering < 0
        worst = jnp.where(fresh, jnp.argmax(violation), state.entering)
        solved = fresh & ~(violation[worst] > TOLERANCE)
        force, normal = jnp.where(fresh, zero, state.force), scaled[worst]
        used = state.active >= 0
        spans = jnp.where(used[:, None], scaled[state.active], 0.0)
        gram = (spans[:, None] * spans).sum(-1) + jnp.diag(jnp.where(used, 0.0, 1.0))
        share = jax.scipy.linalg.cho_solve(
            jax.scipy.linalg.cho_factor(gram, lower=True), (spans * normal).sum(-1)
        )
        way = normal - (spans * share[:, None]).sum(0)
        length, whole = (way**2).sum(), (normal**2).sum()
        # Steps to the constraint, and to the first active one that ceases to push.
        full = jnp.where(length > DEPENDENT * whole, violation[worst] / length, jnp.inf)
        ratios = jnp.where(used & (share > 0.0), state.forces / share, jnp.inf)
        first = jnp.argmin(ratios)
        step = jnp.minimum(full, ratios[first])
        stuck = jnp.isinf(step)
        adds = full <= ratios[first]
        step = jnp.where(stuck, 0.0, step)
        forces, force = state.forces - step * share, force + step
        place = jnp.where(adds, jnp.argmin(used), first)
        changed = np.arange(number) == place
        active = jnp.where(changed, jnp.where(adds, worst, -1), state.active)
        forces = jnp.where(changed, jnp.where(adds, force, 0.0), jnp.where(used, forces, 0.0))
        entering = jnp.where(adds, -1, worst)
        moved = state._replace(
            point=state.point - step * way,
            active=active,
            forces=forces,
            entering=entering,
            force=force,
            done=stuck,
            iterations=state.iterations + 1,
        )
        ended = state._replace(done=jnp.array(True), found=jnp.array(True))
        return jax.tree.map(lambda a, b: jnp.where(solved, a, b), ended, moved)

    state = jax.lax.while_loop(
        lambda state: ~state.done & (state.iterations < MOST), advance, start
    )
    point = solve(state.point, transposed=True)
    finite = jnp.isfinite(point).all()
    return Solution(point, state.found & finite, state.iterations)
