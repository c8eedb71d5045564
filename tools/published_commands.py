"""Commands behind the published rows of docs/results/learning.csv, by the queue of runs."""

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.results import Name
from softgym_mj.learning.tables import table as numbers_of
from tools import learned
from tools.pages import table
from tools.queued_runs import QueuedRun, read_queue


def commands() -> str:
    """Returns the table of commands, with a row for each published row.

    Raises:
        InvalidArgumentError: for a row whose run the queue lacks.
    """
    rows, queue = learned.rows(), read_queue(learned.RESULTS / "queue.toml")
    found = []
    for line in (line for line in numbers_of(rows, []) if line["preset"] != "small"):
        name = Name(*(line[key] for key in Name._fields))
        own = [row for row in rows if row.name == name]
        run = next((run for run in queue if _is_of(run, name) and run.is_done(own)), None)
        if run is None:
            raise InvalidArgumentError("row", tuple(name), "of a run in queue.toml")
        found.append(f"| {learned.label(name.task, name.actor)} | `{run.command}` |")
    return table("| task | command |", found)


def _is_of(run: QueuedRun, name: Name) -> bool:
    """Returns whether a run has the row's task, actor, method, observation and replay."""
    return (run.task, run.actor, run.method, run.observation, run.replay) == (
        name.task, name.actor, name.method, name.observation, name.replay
    )  # fmt: skip
