"""`ArmState`: state of the arms of environments, read from arms of environments and back."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm.actor import ArmActor
from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.command_filter import Filter
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY, JointServos

_TURNS = "turn_"  # Prefix of the names of arrays of `ArmState.turns`.


class ArmState(NamedTuple):
    """State of the arms of environments: n arms with m joints each, and two fingers.

    Attributes:
        positions, speeds: joints, then fingers (num_envs, n, m + 2) [rad and m, and each second].
        reference, rates: joint angles of the controller's reference and its joint velocities
            (num_envs, n, m) [rad], [rad/s].
        start, goal: commands of the servos at the last solution and at the next (num_envs, n, m)
            [rad].
        filter: command filter; arrays (num_envs, n, 3), or of commanded joints (num_envs, n m, 1).
        fingers: commands of the fingers (num_envs, n, 2) [m].
        reference_points: tool points of the reference (num_envs, n, 3) [m].
        failures: number of solutions that failed (num_envs,).
        limits: lowest and highest commanded point (num_envs, 2, 3) [m]; not of arms with cups.
        turns, oriented: filter of rotations, relative to the orientations (num_envs, n, 4) of the
            tools, with the action "pose" only.
    """

    positions: jax.Array
    speeds: jax.Array
    reference: jax.Array
    rates: jax.Array
    start: jax.Array
    goal: jax.Array
    filter: Filter
    fingers: jax.Array
    reference_points: jax.Array
    failures: jax.Array
    limits: jax.Array | None = None
    turns: Filter | None = None
    oriented: jax.Array | None = None


def read_state(arms: ArmActor) -> dict[str, np.ndarray]:
    """Returns a row of the state by name, from the arms of an environment between env steps.

    Raises:
        InvalidArgumentError: if the controller is between two solutions.
    """
    state, number = arms.get_state(), arms.servos.number
    phase = int(state["phase"])
    if phase != SOLVE_EVERY - 1:
        raise InvalidArgumentError("phase", phase, [SOLVE_EVERY - 1])
    servos = arms.servos
    data, fingers = servos.fingers.data, servos.fingers

    def joined(values, own, hands):
        return np.concatenate([values[own].reshape(number, -1), values[hands]], axis=1)

    def filtered(name, prefix):
        names = (prefix + field for field in Filter._fields)
        return dict(zip(names, state[name], strict=True)) if name in state else {}

    return {
        "positions": joined(data.qpos, servos.positions_at, fingers.positions_at),
        "speeds": joined(data.qvel, servos.speeds_at, fingers.speeds_at),
        "reference": state["configuration"].reshape(number, -1),
        "rates": state["velocity"].reshape(number, -1),
        "start": state["servo"][0].reshape(number, -1),
        "goal": state["servo"][1].reshape(number, -1),
        **filtered("filter", ""),
        **filtered("turns", _TURNS),
        **({"oriented": state["oriented"]} if "oriented" in state else {}),
        "fingers": data.ctrl[fingers.motors],
        "reference_points": arms.controller.points(),
        **({"limits": np.array(arms.limits)} if isinstance(arms, Arms) else {}),
        "failures": state["failures"].astype(np.int32),
    }


def joint_views(servos: JointServos) -> dict[str, np.ndarray]:
    """Returns views of the arms' positions, speeds and finger commands in a scene, by name."""
    data, fingers, number = servos.fingers.data, servos.fingers, servos.number
    size, views = number * (len(servos.joints) + 2), {}
    for name, array, joints, own in (
        ("arm_qpos", data.qpos, servos.positions_at, fingers.positions_at),
        ("arm_qvel", data.qvel, servos.speeds_at, fingers.speeds_at),
    ):
        order = np.concatenate([joints.reshape(number, -1), own], axis=1).ravel()
        assert np.array_equal(order, order[0] + np.arange(size)), "joints, then fingers"
        views[name] = array[order[0] : order[0] + size]
    for i, (first, last) in enumerate(fingers.motors.tolist()):
        views[f"fingers_{i}"] = data.ctrl[first : last + 1]
    return views


def joint_state(own: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns arrays for `joint_views` from a row of the state by name."""
    arms = {"arm_qpos": own["positions"].ravel(), "arm_qvel": own["speeds"].ravel()}
    return arms | {f"fingers_{k}": commands for k, commands in enumerate(own["fingers"])}


def packed(arrays: Mapping[str, Any]) -> ArmState:
    """Returns the state from its arrays by name, as in `read_state`; others are ignored."""
    own, fields = {name: arrays[name] for name in ArmState._fields if name in arrays}, {}
    for name, prefix in (("filter", ""), ("turns", _TURNS)):
        names = [prefix + field for field in Filter._fields]
        if names[0] in arrays:
            fields[name] = Filter(*(arrays[each] for each in names))
    return ArmState(**fields, **own)


def unpacked(state: ArmState) -> dict[str, Any]:
    """Returns the arrays of a state by name, as in `read_state`."""
    arrays = {name: array for name, array in state._asdict().items() if array is not None}
    for name, prefix in (("filter", ""), ("turns", _TURNS)):
        if name in arrays:
            fields = arrays.pop(name)._asdict()
            arrays |= {prefix + field: array for field, array in fields.items()}
    return arrays


def control_state(own: ArmState) -> dict[str, np.ndarray]:
    """Returns `get_state` of the arms of one environment (NumPy), without grips and cups."""
    return {
        "configuration": own.reference.ravel(),
        "velocity": own.rates.ravel(),
        "failures": own.failures.astype(int),
        "phase": np.array(SOLVE_EVERY - 1),
        "servo": np.array([own.start.ravel(), own.goal.ravel()]),
        "filter": np.array(own.filter),
        **({} if own.turns is None else {"turns": np.array(own.turns)}),
        **({} if own.oriented is None else {"oriented": own.oriented}),
    }
