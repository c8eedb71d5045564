"""Figures of images and of results (bars by policy, curves over a planner's horizon)."""

import io
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.evaluation.comparison import labels
from softgym_mj.evaluation.statistics import quartiles_over
from softgym_mj.exceptions import InvalidArgumentError, check_name, import_extra
from softgym_mj.storage.files import write_whole

_LOWEST = -0.5  # Lower end of the axis; worse policies would compress the others.
_MARGIN = 0.05  # Between the highest score and the upper end of the axis.
_PICTURE, _TITLE = 2.4, 0.3  # Heights of a picture of `show` and of its title [inches].
_BAR, _INCHES, _DPI = 0.8, 0.8, 150  # Height of a group of bars; inches of a task; dots per inch.


def show(
    pictures: Sequence[np.ndarray],
    titles: Sequence[str],
    *,
    columns: int | None = None,
    height: float = _PICTURE,
) -> None:
    """Shows images in a grid, as a figure of pyplot (in a notebook, below the cell).

    Args:
        pictures: Images (h, w, 3) uint8, or arrays (h, w) of numbers, drawn in colors from their
            minimum (dark) to their maximum (light); NaN is white.
        titles: One title for each image.
        columns: Images in a row; None for all.
        height: Height of an image [inches].

    Raises:
        InvalidArgumentError: unless there are as many titles as pictures, and at least one.
        UnavailableError: without Matplotlib.
    """
    if not len(pictures) or len(titles) != len(pictures):
        raise InvalidArgumentError("titles", titles, f"one for each of {len(pictures)} pictures")
    plt = import_extra("matplotlib.pyplot", "Matplotlib", "plot")
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


def bars(results: Sequence[Mapping], file: pathlib.Path) -> None:
    """Draws a group of bars for each task: medians, with the quartiles as whiskers."""
    names = labels(results)
    groups = list(dict.fromkeys(names))
    tasks = list(dict.fromkeys(result["task"] for result in results))
    figure = new_figure(6.4, 1.0 + _INCHES * len(tasks))
    axes = figure.subplots()
    height, highest = _BAR / len(groups), 1.0
    for i, group in enumerate(groups):
        own = {r["task"]: r for r, name in zip(results, names, strict=True) if name == group}
        offset = (i - (len(groups) - 1) / 2) * height
        places = [tasks.index(task) + offset for task in own]
        numbers = np.array([_quartiles(result) for result in own.values()])
        whiskers = np.abs(numbers[:, 1:].T - numbers[:, 0])
        axes.barh(places, numbers[:, 0], height, xerr=whiskers, label=group, capsize=2)
        highest = max(highest, numbers.max())
        for place, (median, _, high) in zip(places, numbers, strict=True):
            if median < _LOWEST:  # The bar leaves the axes, so its value is written beside zero.
                _note(axes, max(0.0, high), place, f"{median:.1f}")
        for j, task in enumerate(tasks):
            if task not in own:
                _note(axes, 0.0, j + offset, "no result")
    axes.set_xlim(max(axes.get_xlim()[0], _LOWEST), highest + _MARGIN)
    axes.set_yticks(range(len(tasks)), tasks)
    axes.invert_yaxis()
    axes.axvline(1.0, color="0.6", linewidth=0.8, linestyle=":")
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    axes.set_xlabel(_score(results), fontsize="small")
    axes.legend(fontsize="small", ncols=min(len(groups), 5), loc="lower center",
                bbox_to_anchor=(0.5, 1.0), frameon=False)  # fmt: skip
    _save(figure, file)


def curves(results: Sequence[Mapping], file: pathlib.Path) -> None:
    """Draws a curve for each task and planner over the planning horizon."""
    lines: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    for result in results:
        key = result["task"], result["policy"]
        lines.setdefault(key, []).append((result["planning"]["horizon"], *_quartiles(result)))
    figure = new_figure(5.0, 3.4)
    axes = figure.subplots()
    for (task, policy), points in lines.items():
        x, median, low, high = np.array(sorted(points)).T
        (line,) = axes.plot(x, median, marker="o", label=f"{task}, {policy}")
        axes.fill_between(x, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set_xlabel("planning horizon [env steps]")
    axes.set_ylabel(_score(results), fontsize="small")
    axes.legend(fontsize="small", frameon=False)
    _save(figure, file)


def _note(axes: Any, x: float, y: float, text: str) -> None:
    """Writes a text to the right of a point."""
    axes.text(x, y, f" {text}", va="center", fontsize="x-small", color="0.3")


def _quartiles(result: Mapping) -> tuple[float, float, float]:
    """Returns median, low and high quartile."""
    summary = result["summary"]
    return summary["median"], summary["percentile_25"], summary["percentile_75"]


def _score(results: Sequence[Mapping]) -> str:
    """Returns the label of the score axis."""
    over = sorted({quartiles_over(result["episodes"]) for result in results})
    return f"normalized performance\n(median, quartiles over {' or '.join(over)})"


def new_figure(width: float, height: float) -> Any:
    """Returns a Matplotlib figure [inches] without pyplot, which needs no display.

    Raises:
        UnavailableError: without Matplotlib.
    """
    module = import_extra("matplotlib.figure", "Matplotlib", "plot")
    return module.Figure(figsize=(width, height))


def _save(figure, file: pathlib.Path) -> None:
    kinds = [f".{kind}" for kind in sorted(figure.canvas.get_supported_filetypes())]
    check_name("kind of picture", file.suffix.lower(), kinds)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    content = io.BytesIO()
    figure.savefig(content, format=file.suffix[1:], dpi=_DPI, bbox_inches="tight")
    write_whole(file, content.getvalue())
