"""The command `softgym-mj view`."""

from typing import Annotated, Any

import typer

from softgym_mj.baselines.policies import SIMPLE
from softgym_mj.console import Actor, Task, console
from softgym_mj.exceptions import RenderingUnavailableError, check_name
from softgym_mj.registry import TASKS
from softgym_mj.rendering import has_display
from softgym_mj.variations import check_variation
from softgym_mj.viewing.session import TELEOPERATE, Session


def view(
    task: Task,
    policy: Annotated[
        str, typer.Option(help=f"{TELEOPERATE}, {', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = TELEOPERATE,
    actor: Actor = None,
    variation: Annotated[int, typer.Option(help="Variation 0..999.")] = 800,
) -> None:
    """Shows a task in MuJoCo's viewer; you play it by hand, or a policy does."""
    check_name("task", task, TASKS)
    check_variation(variation)
    settings: dict[str, Any] = {} if actor is None else {"actor": actor}
    if not has_display():
        raise RenderingUnavailableError(
            "the viewer needs a display and neither DISPLAY nor WAYLAND_DISPLAY is set; "
            f"make a video: softgym-mj rollout {task} --video videos"
        )
    from softgym_mj.viewing.keys import keys_of
    from softgym_mj.viewing.window import Window, check_display

    session = Session(task, policy, variation, **settings)
    check_display()
    for key in keys_of(session.teleoperation):
        console.print(f"{key.label:>10}  {key.use}")
    Window(session).run()
