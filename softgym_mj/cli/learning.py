"""The commands `softgym-mj learning`: table, join and submit."""

import pathlib
from typing import Annotated

import rich.box
import rich.table
import typer

from softgym_mj.cli.console import Device, Jobs, Ray, Trust, console
from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import write_csv

app = typer.Typer(
    help="Compares trainings with published results; joins and scores trainings.",
    no_args_is_help=True,
)
Folders = Annotated[
    list[pathlib.Path] | None,
    typer.Argument(help="Folders of trainings or of planner evaluations.", metavar="FOLDER..."),
]
Results = Annotated[pathlib.Path, typer.Option(help="Folder of learning.csv and references.csv.")]
RESULTS = pathlib.Path("docs/results")
_RANGES = ("percentile_25", "percentile_75"), ("iqm_low", "iqm_high")
_NUMBERS = (*_RANGES[0], *_RANGES[1], "minutes", "gap", "published")  # None where unknown.


@app.command("table")
def print_table(
    folders: Folders = None,
    merge: Annotated[
        bool, typer.Option("--merge", help="Add the curves of the folders to learning.csv.")
    ] = False,
    csv: Annotated[
        pathlib.Path | None, typer.Option(help="Also write the table, with all numbers.")
    ] = None,
    results: Results = RESULTS,
) -> None:
    """Prints published results (last checkpoint, held-out variations) and those of folders.

    Minutes are for all seeds together, gap is train minus held-out, others are published numbers
    of references.csv.
    """
    from softgym_mj.learning import results as learned
    from softgym_mj.learning.entering import enter
    from softgym_mj.learning.tables import table

    file = _published(results, "learning.csv")
    known = learned.read_rows(file)
    read = enter if merge else learned.read_folder
    rows = learned.merged(known, *map(read, folders or ()))
    lines = table(rows, learned.read_references(_published(results, "references.csv")))
    shown = rich.table.Table(show_lines=True, box=rich.box.SIMPLE)
    titles = (
        "task\nhow",
        "median\nquartiles",
        "IQM\n95 %",
        "seeds\nepis.",
        "env steps\nupdates\nmin",
    )
    for title in (*titles, "gap\nothers"):
        shown.add_column(title, no_wrap=True)
    for line in lines:
        form = {key: "" if line[key] is None else f"{line[key]:.2f}" for key in _NUMBERS}
        quartiles, interval = (
            f"{form[low]}..{form[high]}" if form[low] else "" for low, high in _RANGES
        )
        shown.add_row(
            f"{line['task']} {line['actor']}\n{line['method']} {line['observation']}\n"
            f"{line['preset']} {line['replay']}",
            f"{line['median']:.3f}\n{quartiles}",
            f"{line['iqm']:.3f}\n{interval}",
            f"{line['seeds']}\n{line['episodes']}",
            f"{line['env_steps']:,}\n{line['updates']:,}\n{form['minutes']}",
            f"{form['gap']}\n{form['published']}",
        )
    console.print(shown if lines else "There are no final rows yet.")
    if csv is not None:
        write_csv(csv, list(lines[0]) if lines else (), lines)
        console.print(f"wrote {csv}")
    if merge:
        learned.write_rows(rows, file)
        number = len(rows) - len(known)
        console.print(f"wrote {file}: {len(rows)} rows, {number} of them new")


def _published(folder: pathlib.Path, name: str) -> pathlib.Path:
    """Returns the path of a file of the published results.

    Raises:
        StoreError: if the folder does not have it.
    """
    if not (folder / name).exists():
        raise StoreError(
            f"there is no {folder / name}: published results are in docs/results of a clone of "
            "the repository, not in the installed package; run this command there or pass "
            "--results FOLDER"
        )
    return folder / name


@app.command()
def join(
    folders: Annotated[
        list[pathlib.Path], typer.Argument(help="Finished trainings.", metavar="FOLDER...")
    ],
    out: Annotated[pathlib.Path, typer.Option(help="Folder of the result.")] = pathlib.Path(
        "joined"
    ),
) -> None:
    """Joins trainings that differ in their seeds, such as those of two GPUs, into one result."""
    from softgym_mj.learning import joining

    seeds = joining.join(folders, out)
    console.print(f"wrote {out / 'curve.csv'}, of seeds {', '.join(map(str, seeds))}")


@app.command()
def submit(
    folder: Annotated[
        pathlib.Path, typer.Argument(help="Folder with card.json and policy_SEED.pt2 files.")
    ],
    trust: Trust = False,
    jobs: Jobs = 1,
    ray: Ray = None,
    device: Device = "cpu",
) -> None:
    """Scores policies trained elsewhere; writes the curve that `table --merge` reads.

    Each policy_SEED.pt2 plays 200 held-out variations and 200 of training. The same command
    continues one that was stopped.
    """
    from softgym_mj.cli.evaluation import progress_of
    from softgym_mj.learning import submission as submitted
    from softgym_mj.parallel.executors import make_executor

    submission = submitted.read_submission(folder)
    with progress_of(submission.configuration) as progress, make_executor(jobs, ray) as executor:
        rows = submitted.submit(submission, executor, progress, trust=trust, device=device)
    for row in rows:
        if row.split == "evaluate":
            console.print(
                f"seed {row.seed}: {row.normalized_performance:.3f}, success {row.success:.2f}"
            )
    console.print(f"wrote {folder / 'curve.csv'} and {folder / 'episodes.csv'}")
