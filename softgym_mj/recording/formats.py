"""Dataset formats by name."""

from collections.abc import Callable

from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.recording.datasets import Format, letters
from softgym_mj.recording.lerobot_format import LeRobot
from softgym_mj.recording.minari_format import Minari

FORMATS: dict[str, Callable[..., Format]] = {"minari": Minari, "lerobot": LeRobot}


def make_format(name: str, codec: str | None = None) -> Format:
    """Returns one of `FORMATS`; a codec of None is the format's default.

    Raises:
        InvalidArgumentError: for an unknown format or codec, or a codec of a format without videos.
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
    """Returns the default id of a dataset, such as "softgym_mj/fold_cloth/scripted-franka-v0".

    Args:
        task: Task name, without a module.
        policy: Policy, as in `record`.
        actor, grasp, action: Arguments of the task; None (the default) is not in the id.
        noise: Noise, as in `record`; 0.05 becomes "noise0-05", as ids contain no dot.
        format: One of `FORMATS`; "lerobot" has ids of two parts, as Hugging Face requires:
            "softgym_mj/fold_cloth-scripted-franka".
    """
    words = letters(policy, actor, grasp, action, f"noise{noise:g}" if noise else None)
    return make_format(format).default_id.format(task=task, words=words)
