"""The command `softgym-mj view`."""

from typing import Annotated

import typer

from softgym_mj.cli.console import Actor, Grasp, Look, Task, Trust, console, given, policy_file
from softgym_mj.exceptions import check_name
from softgym_mj.policies.exported import observes
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.policies.saved import is_saved
from softgym_mj.registry import find
from softgym_mj.variations.indices import check_variation
from softgym_mj.viewing.session import TELEOPERATE, Session


def view(
    task: Task,
    policy: Annotated[
        str, typer.Option(help=f"{TELEOPERATE}, {', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = TELEOPERATE,
    trust: Trust = False,
    actor: Actor = None,
    grasp: Grasp = None,
    look: Look = None,
    variation: Annotated[int, typer.Option(help="Variation 0..999.")] = 800,
    browser: Annotated[
        bool, typer.Option("--browser", help="Show it in a browser; needs no display.")
    ] = False,
    host: Annotated[
        str, typer.Option(help="Address for browsers; 0.0.0.0 lets other machines in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port for browsers; 0 for any free one.")] = 8080,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(help="Origin of a proxy that serves the page: https://NAME; repeatable."),
    ] = None,
) -> None:
    """Shows a task in MuJoCo's viewer or a browser, teleoperated or with a policy."""
    find(task)
    check_variation(variation)
    policy = policy_file(policy)
    if not is_saved(policy):
        check_name("policy", policy, (TELEOPERATE, *SIMPLE, "FILE.pt2", "MODULE:FUNCTION"))
    settings = {**observes(policy), **given(actor=actor, grasp=grasp, look=look)}
    if browser:
        from softgym_mj.viewing.browser import Browser, open_server

        with open_server(host, port, allow_origin or ()) as server:
            session = Session(task, policy, variation, trust=trust, **settings)
            console.print("Press Ctrl+C to stop")
            Browser(session, server).run()
        return
    from softgym_mj.viewing.keys import keys_of
    from softgym_mj.viewing.window import Window, check_display

    check_display(task)
    session = Session(task, policy, variation, trust=trust, **settings)
    for key in keys_of(session.teleoperation):
        console.print(f"{key.label:>10}  {key.use}")
    Window(session).run()
