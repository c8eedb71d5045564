"""`Scenario`: how a tool moves a cloth; baselines.

Errors of the recordings are corrected without a solver. The camera's pitch is off: nodes are turned
about the tool's first place until a cloth at rest hangs vertically. Stamps are late, by a delay
that differs between frames: a frame is dated by the place of the held edge on the path of the tool.
The tracker often takes another part of the hem for a corner, and then all nodes are displaced
within the cloth: frames are left out whose held edge is not on the tool, or whose grid is too
short or long.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from softgym_mj.exceptions import StoreError
from softgym_mj.reality.cloth.recordings import Recording

DELAY = 0.33  # [s] Mean delay of a stamp: with it, the held edge moves least in the tool's frame.
DELAYS = np.arange(-0.15, 0.151, 0.01) + DELAY  # [s] Delays that are tried.
DELAY_SPREAD = 0.05  # [s] Standard deviation of the delay.
NOISE = 0.01  # [m] Weight of a distance of the held edge from the tool, against `DELAY_SPREAD`.
HELD_WITHIN = 0.015  # [m] Largest mean distance of the held edge from the tool.
MOVED = 0.005  # [m] Distance of the tool from its first place at which it has moved.
LENGTH_WITHIN = 0.15  # Largest deviation of rows and columns from their median lengths.
_INNER = slice(1, -1)  # The tracker rounds corners off: those of the held edge hang 12 mm low.


@dataclasses.dataclass(frozen=True)
class Grip:
    """How a session's cloth hangs on the tool.

    Attributes:
        edge: (n, 3) [m] nodes of the held edge in the tool's frame, evenly on a straight line.
        lengths: (2,) [m] median lengths of rows along the edge and of columns down from it.
        pitch: Angle [rad] about the robot's X by which recorded nodes are turned.
    """

    edge: np.ndarray
    lengths: np.ndarray
    pitch: float


@dataclasses.dataclass(frozen=True)
class Scenario:
    """Motion of the tool, and the frames that are compared.

    Attributes:
        recording: Name of the recording.
        start: (n, n, 3) [m] nodes in the first counted frame, which baselines see.
        edge: (s, n, 3) [m] path of the held edge at `edge_times` (s,) [s].
        edge_times: times of the tool's poses [s].
        times: (f,) [s] counted frames after the first, in order.
        tool: positions (f + 1, 3) [m] and rotations of the tool, in the first frame and in these.
    """

    recording: str
    start: np.ndarray
    edge: np.ndarray
    edge_times: np.ndarray
    times: np.ndarray
    tool: tuple[np.ndarray, Rotation]


def grip_of(recordings: Sequence[Recording]) -> Grip:
    """Returns the grip: medians over all recordings of a session.

    Raises:
        StoreError: If no frame has all nodes, or grids have different sizes.
    """
    if len({recording.nodes.shape[1] for recording in recordings}) > 1:
        raise StoreError("recordings of a session have grids of different sizes")
    pitch = _pitch(recordings)
    edges, lengths = [], []
    for recording in (_turned(recording, pitch) for recording in recordings):
        complete = is_complete(recording)
        held = recording.nodes[complete][:, :, 0]
        edges.append(_in_tool(recording, held, recording.stamps[complete] - DELAY))
        lengths.append(_lengths(recording.nodes[complete]).reshape(2, -1))
    if not sum(map(len, edges)):
        raise StoreError("no frame has all nodes")
    edge = np.median(np.concatenate(edges), axis=0)
    index = np.arange(len(edge), dtype=float)
    lines = np.polynomial.polynomial.polyfit(index[_INNER], edge[_INNER], 1)
    straight = np.polynomial.polynomial.polyval(index, lines).T
    return Grip(straight, np.median(np.concatenate(lengths, axis=1), axis=1), pitch)


def scenario_of(
    recording: Recording, grip: Grip, every: bool = False
) -> tuple[Scenario, np.ndarray]:
    """Returns the scenario of a recording, and nodes (f, n, n, 3) [m] in its frames.

    Args:
        recording: Recording.
        grip: Grip.
        every: Whether all frames with all nodes count.

    Raises:
        StoreError: If less than two frames count.
    """
    counted, times, nodes = counted_frames(recording, grip, every)
    if len(counted) < 2:
        raise StoreError(
            f"recording {recording.name}: {len(counted)} frames count, expected 2 or more"
        )
    places, turns = recording.tool(recording.tool_times)
    scenario = Scenario(
        recording.name,
        nodes[0],
        _moved(grip.edge, places, turns),
        recording.tool_times,
        times[1:],
        recording.tool(times),
    )
    return scenario, nodes[1:]


def counted_frames(
    recording: Recording, grip: Grip, every: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns frames that count, or all with all nodes, in the order of their times.

    Returns:
        Indices (f,), times (f,) [s], and nodes (f, n, n, 3) [m], whose pitch is corrected.
    """
    recording = _turned(recording, grip.pitch)
    complete = np.flatnonzero(is_complete(recording))
    held = recording.nodes[complete][:, :, 0]
    tried = []
    for delay in DELAYS:
        placed = _in_tool(recording, held, recording.stamps[complete] - delay)
        off = np.linalg.norm(placed - grip.edge, axis=2)[:, _INNER]
        tried.append(off.mean(axis=1))
    away = np.array(tried)
    unlikely = ((DELAYS - DELAY) / DELAY_SPREAD)[:, None]
    best = np.argmin((away / NOISE) ** 2 + unlikely**2, axis=0)
    times = recording.stamps[complete] - DELAYS[best]
    short = np.abs(_lengths(recording.nodes[complete]) / grip.lengths[:, None, None] - 1.0)
    whole = (short < LENGTH_WITHIN).all(axis=(0, 2))
    near = away[best, np.arange(len(complete))] < HELD_WITHIN
    order = np.argsort(times, kind="stable")
    kept = order[(whole & near | every)[order]]
    return complete[kept], times[kept], recording.nodes[complete[kept]]


class NothingMoves:
    """Baseline: the cloth stays where it was in the first frame."""

    name = "nothing moves"
    models: tuple[str, ...] = ()

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns nodes (f, n, n, 3) [m] at rest."""
        return np.repeat(scenario.start[None], len(scenario.times), axis=0)


class RigidSheet:
    """Baseline: the cloth of the first frame moves with the tool as a rigid body."""

    name = "rigid sheet on the tool"
    models: tuple[str, ...] = ()

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns nodes (f, n, n, 3) [m] moved with the tool."""
        places, turns = scenario.tool
        nodes = scenario.start.reshape(-1, 3)
        fixed = turns[0].inv().apply(nodes - places[0])
        return _moved(fixed, places[1:], turns[1:]).reshape(-1, *scenario.start.shape)


def is_at_rest(recording: Recording, times: np.ndarray) -> np.ndarray:
    """Returns whether times (f,) [s] are before the tool has moved: (f,)."""
    away = np.linalg.norm(recording.tool_positions - recording.tool_positions[0], axis=1) > MOVED
    return times < np.min(recording.tool_times[away], initial=np.inf)


def _pitch(recordings: Sequence[Recording]) -> float:
    """Returns the angle [rad] about X that makes columns of cloths at rest vertical, a median."""
    downs = []
    for recording in recordings:
        resting = is_complete(recording) & is_at_rest(recording, recording.stamps - DELAY)
        nodes = recording.nodes[resting][:, _INNER]
        downs.append((nodes[:, :, -1] - nodes[:, :, 0]).mean(axis=1))
    down = np.concatenate(downs)
    return -float(np.median(np.arctan2(down[:, 1], -down[:, 2]))) if len(down) else 0.0


def _turned(recording: Recording, pitch: float) -> Recording:
    """Returns a recording whose nodes are turned by an angle [rad] about X at the tool's start."""
    center = recording.tool_positions[0]
    turn = Rotation.from_euler("x", pitch).as_matrix()
    return dataclasses.replace(recording, nodes=(recording.nodes - center) @ turn.T + center)


def is_complete(recording: Recording) -> np.ndarray:
    """Returns whether frames (f,) have all nodes."""
    return ~np.isnan(recording.nodes).any(axis=(1, 2, 3))


def _moved(points: np.ndarray, places: np.ndarray, turns: Rotation) -> np.ndarray:
    """Returns points (k, 3) of the tool's frame at its poses: (f, k, 3) [m]."""
    return np.einsum("fij,kj->fki", turns.as_matrix(), points) + places[:, None]


def _in_tool(recording: Recording, points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Returns points (f, k, 3) [m] at times (f,) [s] in the tool's frame."""
    places, turns = recording.tool(times)
    return np.einsum("fji,fkj->fki", turns.as_matrix(), points - places[:, None])


def _lengths(nodes: np.ndarray) -> np.ndarray:
    """Returns lengths (2, f, n) [m] of rows and of columns of grids (f, n, n, 3) [m]."""
    return np.stack(
        [np.linalg.norm(np.diff(nodes, axis=axis), axis=3).sum(axis=axis) for axis in (1, 2)]
    )
