"""Figures: pictures beside each other; of results, bars of policies and curves over a setting."""

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.evaluation import PROTOCOL, read_json
from softgym_mj.exceptions import OutOfRangeError, ResultError, check_name
from softgym_mj.extras import import_extra

AXES = ("horizon", "budget", "replan_every")
_NEEDED = ("protocol", "task", "policy", "settings", "planning", "summary", "episodes")
_LOWEST = -0.5  # Of the axis: worse policies would squeeze the others.
_PICTURE, _TITLE = 2.4, 0.3  # Heights of a picture of `show` and of its title [inches].
_BAR, _INCHES, _DPI = 0.8, 1.9, 150  # Width of a group of bars; inches of a task; dots per inch.


def show(
    pictures: Sequence[np.ndarray],
    titles: Sequence[str],
    *,
    columns: int | None = None,
    height: float = _PICTURE,
) -> None:
    """Shows pictures beside each other, as a figure of pyplot: in a notebook, below the cell.

    Args:
        pictures: images (h, w, 3) uint8, or (h, w) of numbers, which are drawn as colours from
            their least (dark) to their largest (light); NaN stays white.
        titles: one for each.
        columns: pictures in a row; None for all of them.
        height: of a picture [inches].

    Raises:
        OutOfRangeError: unless there are as many titles as pictures, and at least one.
        MissingExtraError: without Matplotlib.
    """
    if not len(pictures) or len(titles) != len(pictures):
        raise OutOfRangeError("titles", titles, f"one for each of {len(pictures)} pictures")
    plt = import_extra("matplotlib.pyplot", "Matplotlib", "notebooks")
    columns = min(columns or len(pictures), len(pictures))
    rows = -(-len(pictures) // columns)
    width = height * max(picture.shape[1] / picture.shape[0] for picture in pictures)
    size = (width * columns, (height + _TITLE) * rows)
    figure, grid = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    for axes in grid.flat:
        axes.axis("off")
    for axes, picture, title in zip(grid.flat, pictures, titles, strict=False):
        axes.imshow(picture)
        axes.set_title(title, fontsize="medium")
    plt.show()
    plt.close(figure)


def read_results(files: Sequence[pathlib.Path]) -> list[dict]:
    """Results of evaluations.

    Raises:
        ResultError: for what is no result, is of another protocol version, or for none at all.
    """
    if not files:
        raise ResultError("there are no results to plot; name the result.json of evaluations")
    results = []
    for file in files:
        result = read_json(file / "result.json" if file.is_dir() else file)
        missing = [key for key in _NEEDED if key not in result]
        if missing:
            raise ResultError(f"{file} is not the result of an evaluation: no {missing[0]!r}")
        results.append(result)
    versions = {str(file): result["protocol"] for file, result in zip(files, results, strict=True)}
    if set(versions.values()) != {PROTOCOL}:
        raise ResultError(
            f"results of protocol versions {sorted(set(versions.values()))} cannot be compared "
            f"with this one, {PROTOCOL}: {versions}; evaluate again"
        )
    return results


def labels(results: Sequence[Mapping]) -> list[str]:
    """A name for each result: its policy, and what tells it from others of the same policy."""
    names = []
    for result in results:
        rivals = [other for other in results if other["policy"] == result["policy"]]
        details = []
        for part in ("settings", "planning"):
            own = result[part] or {}
            for key, value in own.items():
                # Horizons differ from task to task; what counts is whether they do within one.
                values = {
                    str((other[part] or {}).get(key))
                    for other in rivals
                    if other["task"] == result["task"]
                }
                if len(values) > 1:
                    details.append(f"{key}={value}")
        names.append(" ".join([result["policy"], *details]))
    return names


def spread(result: Mapping) -> tuple[float, float, float]:
    """Median and quartiles: over seeds, or over variations where there is one seed only."""
    if len(result["seeds"]) > 1:
        kinds = ("median", "percentile_25", "percentile_75")
        median, low, high = (result["summary"][kind] for kind in kinds)
        return median, low, high
    scores = [episode["normalized_performance"] for episode in result["episodes"]]
    low, median, high = np.percentile(scores, [25, 50, 75]).tolist()
    return median, low, high


def markdown(results: Sequence[Mapping]) -> str:
    """A table of tasks and policies: mean, and least score of an episode."""
    names = labels(results)
    groups = sorted(set(names), key=names.index)
    scores = {(r["task"], name): r["summary"] for r, name in zip(results, names, strict=True)}
    tasks = sorted({task for task, _ in scores}, key=[r["task"] for r in results].index)
    lines = ["| task | " + " | ".join(groups) + " |", "|---" * (len(groups) + 1) + "|"]
    for task in tasks:
        own = [scores.get((task, group)) for group in groups]
        cells = ["" if s is None else f"{s['mean']:.2f} ({s['min']:.2f})" for s in own]
        lines.append(f"| `{task}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def bars(results: Sequence[Mapping], file: pathlib.Path) -> None:
    """Draws a group of bars for each task: medians, with the quartiles as whiskers."""
    names = labels(results)
    groups = sorted(set(names), key=names.index)
    tasks = sorted({result["task"] for result in results}, key=[r["task"] for r in results].index)
    figure = new_figure(max(4.0, _INCHES * len(tasks)), 3.6)
    axes = figure.subplots()
    width = _BAR / len(groups)
    for i, group in enumerate(groups):
        own = {r["task"]: r for r, name in zip(results, names, strict=True) if name == group}
        places = [tasks.index(task) + (i - (len(groups) - 1) / 2) * width for task in own]
        numbers = np.array([spread(result) for result in own.values()])
        whiskers = np.abs(numbers[:, 1:].T - numbers[:, 0])
        axes.bar(places, numbers[:, 0], width, yerr=whiskers, label=group, capsize=2)
        for place, median in zip(places, numbers[:, 0], strict=True):
            if median < _LOWEST:  # The bar leaves the picture: its value stands at its end.
                axes.text(place, _LOWEST, f"{median:.1f}", ha="center", va="bottom", rotation=90)
    axes.set_ylim(bottom=max(axes.get_ylim()[0], _LOWEST))
    axes.set_xticks(range(len(tasks)), [task.replace("_", "\n") for task in tasks])
    axes.axhline(1.0, color="0.6", linewidth=0.8, linestyle=":")
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.set_ylabel("normalised performance")
    axes.legend(fontsize="small", ncols=min(len(groups), 4), loc="lower center",
                bbox_to_anchor=(0.5, 1.0), frameon=False)  # fmt: skip
    _save(figure, file)


def curves(results: Sequence[Mapping], axis: str, file: pathlib.Path) -> None:
    """Draws a curve for each task and planner over a setting of the planner, one of `AXES`.

    Raises:
        UnknownNameError: if there is no such setting.
        ResultError: for results of policies that do not plan.
    """
    check_name("x", axis, AXES)
    lines: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    for result in results:
        if result["planning"] is None:
            raise ResultError(f"{result['policy']!r} does not plan: it has no {axis}")
        key = result["task"], result["policy"]
        lines.setdefault(key, []).append((result["planning"][axis], *spread(result)))
    figure = new_figure(5.0, 3.4)
    axes = figure.subplots()
    for (task, policy), points in lines.items():
        x, median, low, high = np.array(sorted(points)).T
        (line,) = axes.plot(x, median, marker="o", label=f"{task}, {policy}")
        axes.fill_between(x, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set_xlabel(f"planning {axis} [env steps]")
    axes.set_ylabel("normalised performance")
    axes.legend(fontsize="small", frameon=False)
    _save(figure, file)


def new_figure(width: float, height: float) -> Any:
    """A figure of Matplotlib [inches] to be saved: it needs no display and leaves pyplot alone.

    Raises:
        MissingExtraError: without Matplotlib.
    """
    module = import_extra("matplotlib.figure", "Matplotlib", "notebooks")
    return module.Figure(figsize=(width, height))


def _save(figure, file: pathlib.Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=_DPI, bbox_inches="tight")
