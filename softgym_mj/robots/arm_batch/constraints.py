"""Soft constraints of an arm: the coupling of its fingers, limits of its joints, and contacts.

The formulas are those of MuJoCo's integrator "discrete": a row with the reference acceleration a_r
exerts the force D (a_r - J a), implicit in the acceleration a. Limits push but do not pull.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

EDGES = 4  # Edges of a friction pyramid.
LEAST, MOST = mujoco.mjMINIMP, mujoco.mjMAXIMP  # Limits of an impedance.


class Rows(NamedTuple):
    """Constraints of m joints: the coupling, then the limit of each joint: n = m + 1 rows.

    Attributes:
        low, high: limits of joints (m,) [rad or m].
        coupling: derivative of the coupling by the joints (m,).
        zero: joint positions (m,) at which the coupling holds [rad or m].
        inverse: inverse inertia of each row at the model's reference (n,) [1/kg or 1/(kg m^2)].
        time, ratio: time constant [s] and damping ratio of each row (n,).
        impedance: five parameters of the impedance of each row (n, 5).
    """

    low: np.ndarray
    high: np.ndarray
    coupling: np.ndarray
    zero: np.ndarray
    inverse: np.ndarray
    time: np.ndarray
    ratio: np.ndarray
    impedance: np.ndarray


class Contacts(NamedTuple):
    """Further rows, which only push: edges of the friction pyramids of r / 4 contacts.

    The first edges of all pyramids come first, then their second edges, and so on.

    Attributes:
        jacobian: derivatives of gaps by the joints (r, m).
        position: gaps (r,) [m]; infinite where nothing touches.
        inverse, time, ratio, impedance: as in `Rows` (r,), (r,), (r,), (r, 5).
    """

    jacobian: jax.Array
    position: jax.Array
    inverse: jax.Array
    time: jax.Array
    ratio: jax.Array
    impedance: jax.Array


class Active(NamedTuple):
    """Rows in a state.

    Attributes:
        jacobian: rows (n, m).
        reference: reference accelerations (n,) [rad/s^2 or m/s^2].
        stiffness: force for each unit of acceleration (n,) [kg m^2 or kg]; 0 for limits that are
            not reached.
    """

    jacobian: jax.Array
    reference: jax.Array
    stiffness: jax.Array


def rows_of(model: mujoco.MjModel) -> Rows:
    """Returns the constraints of a model whose fingers move by the same distance."""
    assert model.neq == 1 and model.eq_type[0] == mujoco.mjtEq.mjEQ_JOINT
    assert model.jnt_limited.all() and not model.jnt_margin.any()
    first, second = model.eq_obj1id[0], model.eq_obj2id[0]
    assert np.array_equal(model.eq_data[0, :5], [0.0, 1.0, 0.0, 0.0, 0.0])
    low, high = model.jnt_range.T
    coupling = np.zeros(model.njnt)
    coupling[first], coupling[second] = 1.0, -1.0
    solref = np.vstack([model.eq_solref[:1], model.jnt_solref])
    assert np.all(solref > 0.0), "time constant and damping ratio"
    return Rows(
        low=low.copy(),
        high=high.copy(),
        coupling=coupling,
        zero=model.qpos0.copy(),
        inverse=with_coupling(model, model.dof_invweight0),
        time=solref[:, 0],
        ratio=solref[:, 1],
        impedance=np.vstack([model.eq_solimp[:1], model.jnt_solimp]),
    )


def with_coupling(model: mujoco.MjModel, inverse: np.ndarray) -> np.ndarray:
    """Returns `Rows.inverse` (m + 1,) from the inverse inertias (m,) of the model's joints."""
    ends = [model.eq_obj1id[0], model.eq_obj2id[0]]
    return np.append(inverse[ends].sum(), inverse)


def evaluate(
    rows: Rows,
    step: float,
    angles: jax.Array,
    speeds: jax.Array,
    inertia: jax.Array,
    metric: jax.Array,
    contacts: Contacts | None = None,
) -> Active:
    """Returns the rows in a state.

    Args:
        rows: constraints.
        step: physics step [s].
        angles, speeds: positions (m,) and speeds (m,) of the joints.
        inertia, metric: diagonals (m,) of the mass matrix and of the matrix that is implicit in
            servos.
        contacts: rows that follow those of `rows`.
    """
    above, below = angles - rows.low, rows.high - angles
    side = jnp.where(above < below, 1.0, -1.0)
    jacobian = jnp.vstack([rows.coupling, jnp.diag(side)])
    coupled = (rows.coupling * (angles - rows.zero)).sum()
    position = jnp.append(coupled, jnp.minimum(above, below))
    each: list[Any] = [jacobian, position, rows.inverse, rows.time, rows.ratio, rows.impedance]
    if contacts is not None:
        each = [jnp.concatenate(pair) for pair in zip(each, contacts, strict=True)]
    jacobian, position, inverse, time, damping, parameters = each
    speed = (jacobian * speeds).sum(-1)
    is_limit = np.arange(len(position)) > 0

    impedance = _impedance(parameters, jnp.abs(position))
    widest = jnp.clip(parameters[:, 1], LEAST, MOST)
    spring = 1.0 / (widest * time * damping) ** 2
    damper = 2.0 / (widest * time)
    # A limit that is too stiff for the step gets the stiffest row without restitution.
    excess = step**2 * spring * impedance
    most = MOST * (1.0 - impedance) / (impedance * (1.0 - MOST))
    slow = jnp.minimum(damper / jnp.sqrt(excess), jnp.maximum(0.0, most - 2.0) / step)
    stiff = is_limit & (excess > 1.0)
    spring = jnp.where(stiff, 1.0 / (step**2 * impedance), spring)
    damper = jnp.where(stiff, slow, damper)

    factor = 1.0 + step * damper + step**2 * spring * impedance
    softness = jnp.maximum(
        (1.0 - impedance) * inverse / impedance / factor, (1.0 - MOST) * inverse / MOST
    )
    squares = jacobian**2
    ratio = (squares / metric).sum(-1) / (squares / inertia).sum(-1)
    if contacts is not None:  # All edges of a contact have the softness of the first.
        own, edges = jnp.split(ratio, [len(rows.inverse)])
        ratio = jnp.concatenate([own, *([edges[: len(edges) // EDGES]] * EDGES)])
    softness *= ratio
    pull = spring * impedance * position + (damper + step * spring * impedance) * speed
    reached = ~is_limit | (position < 0.0)
    # Rows that nothing reaches have no numbers: their gaps may be infinite.
    pull = jnp.where(reached, pull, 0.0)
    return Active(jacobian, -pull / factor, jnp.where(reached, 1.0 / softness, 0.0))


def _impedance(parameters: Any, distance: jax.Array) -> jax.Array:
    """Returns the impedance of rows with parameters (n, 5) at distances (n,)."""
    low, high = jnp.clip(parameters[:, :2], LEAST, MOST).T
    width, middle = parameters[:, 2], jnp.clip(parameters[:, 3], LEAST, MOST)
    power = jnp.maximum(parameters[:, 4], 1.0)
    x = jnp.clip(distance / jnp.maximum(width, mujoco.mjMINVAL), 0.0, 1.0)
    rising = x**power / middle ** (power - 1.0)
    falling = 1.0 - (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
    return low + jnp.where(x <= middle, rising, falling) * (high - low)


def pushes(rows: Active, acceleration: jax.Array) -> jax.Array:
    """Returns which rows act (n,) bool at an acceleration of the joints (m,)."""
    missing = rows.reference - (rows.jacobian * acceleration).sum(-1)
    is_coupling = np.arange(len(rows.reference)) == 0
    return is_coupling | (missing > 0.0)


def stiffness(rows: Active, acting: jax.Array) -> jax.Array:
    """Returns the term (m, m) of acting rows in the matrix of the equations of motion."""
    weighted = jnp.where(acting, rows.stiffness, 0.0)[:, None] * rows.jacobian
    return (weighted[:, :, None] * rows.jacobian[:, None]).sum(0)


def force(rows: Active, acting: jax.Array) -> jax.Array:
    """Returns the term (m,) of acting rows in the right side of the equations of motion."""
    pull = jnp.where(acting, rows.stiffness * rows.reference, 0.0)
    return (pull[:, None] * rows.jacobian).sum(0)
