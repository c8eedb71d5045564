"""The formats of datasets by name."""

from collections.abc import Callable

from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.recording.datasets import Format, letters
from softgym_mj.recording.lerobot_format import LeRobot
from softgym_mj.recording.minari_format import Minari

FORMATS: dict[str, Callable[..., Format]] = {"minari": Minari, "lerobot": LeRobot}


def make_format(name: str, codec: str | None = None) -> Format:
    """A format.

    Args:
        name: one of `FORMATS`.
        codec: of films; None for the format's own.

    Raises:
        InvalidArgumentError: for an unknown format or codec; for a codec where nothing is filmed.
    """
    check_name("format", name, FORMATS)
    if codec is None:
        return FORMATS[name]()
    if name != "lerobot":
        valid = f"None with format={name!r}, which keeps images without loss"
        raise InvalidArgumentError("codec", codec, valid)
    return LeRobot(codec)


def dataset_name(
    task: str,
    policy: str,
    actor: str | None = None,
    grasp: str | None = None,
    action: str | None = None,
    noise: float = 0.0,
    *,
    format: str = "minari",
) -> str:
    """The id that a dataset gets by default: "softgym_mj/fold_cloth/scripted-franka-v0".

    Args:
        task: task name, without a module.
        policy: as in `record`.
        actor, grasp, action: of the task; None, which the id does not mention, for its own.
        noise: as in `record`; 0.05 is "noise0-05", as ids have no points.
        format: of `FORMATS`; "lerobot" has "softgym_mj/fold_cloth-scripted-franka", as ids of
            Hugging Face have two parts.
    """
    words = letters(policy, actor, grasp, action, f"noise{noise:g}" if noise else None)
    return make_format(format).default_id.format(task=task, words=words)
