"""Numbers that the states of several tasks list, by what they are."""

from softgym_mj import metrics
from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import Episode, State


def corners(state: State, episode: Episode) -> dict[str, Array]:
    """The corners of the cloth, as `Cloth.corners` counts them."""
    found = metrics.taken(state.points["cloth"], episode.shapes["cloth"]["corners"])
    return {f"corner p{i + 1} (x, y, z) [m]": found[..., i, :] for i in range(4)}


CUP_SIZE = 6  # Numbers of `cup`.


def cup(name: str, state: State, episode: Episode) -> dict[str, Array]:
    """A cup's pose and inner measures."""
    pose, size = state.poses[name], episode.shapes[name]["size"]
    return {
        f"{name} x, z [m]": pose[..., :3:2],
        f"{name} theta [rad]": pose[..., 7:],
        f"{name} inner length, width, height [m]": size[..., :3],
    }


def cups(state: State, episode: Episode) -> dict[str, Array]:
    """The poses and inner measures of all cups."""
    each = (cup(name, state, episode) for name in state.poses)
    return {label: values for entries in each for label, values in entries.items()}


def highest_particle(state: State) -> dict[str, Array]:
    """How high the water splashes."""
    top = metrics.highest(state.points["water"], state.present["water"])
    return {"height of the highest particle [m]": top[..., None]}
