"""Tables and the figure of docs/engines.md: docs/engines.json and docs/demonstration.json."""

import json
import math
import pathlib
import statistics
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from benchmarks.engines.sheets import SHEET
from softgym_mj.reality.pictures import Painter, camera_at
from tools.pages import table

DOCS = pathlib.Path(__file__).parent.parent / "docs"
FIGURE = DOCS / "engines.png"
_REACHED = 0.05  # Share by which a calibrated engine may measure something else.
# Of pictures: where the camera is from the middle of the sheets [m], its angle [deg], the size
# [pixels], and the distance of a sheet's dots [m].
_CAMERA, _FIELD_OF_VIEW = np.array([-0.5, -1.1, 0.85]), 25.0
_SIZE, _DOTS = (420, 420), 0.001
# Moments of the kinds of cases, as the tables have them: the rags' are called otherwise.
PLACED = ("lift", "carry", "place", "release")
GROUPS = ("dynamic", "quasi_static", "flat", "folded")
QUANTITIES = {
    "stretch_stiffness": ("stretch [N/m]", 1.0),
    "bend_stiffness": ("bending [µN m]", 1e6),
    "friction": ("friction", 1.0),
}
DEMONSTRATED = {
    "picker": "abstract picker", "sawyer": "simulated Sawyer, friction", "mujoco": "MuJoCo's flex",
}  # fmt: skip


def measured(name: str) -> Any:
    """What docs/<name>.json says."""
    return json.loads((DOCS / f"{name}.json").read_text())


def root_mean_square(values: Iterable[float]) -> float:
    """Of numbers."""
    return math.sqrt(statistics.fmean(value**2 for value in values))


def chosen(found: dict, group: str) -> list[str]:
    """The cases of a group that were played."""
    return [case for case in found["cases"] if case.split()[0] == group]


def last(values: dict[str, list[float]], cases: Iterable[str]) -> float:
    """Root mean square over cases of what is said of their last moments."""
    return root_mean_square(values[case][-1] for case in cases)


def calibration() -> str:
    """What engines measure with the fabric's own numbers, what they are given, what then."""
    found, rows = measured("engines"), []
    for name, own in found["calibration"].items():
        cells = [found["engines"][name]["title"]]
        for quantity, (_, unit) in QUANTITIES.items():
            rounds = own["measured"][quantity]
            given = own["given"][quantity]
            final = next(value for number, value in rounds if number == given)
            first, number, final = (unit * value for value in (rounds[0][1], given, final))
            cells.append(f"{first:.3g} | {number:.3g} | {final:.3g}")
        cells.append(f"{1e6 * own['restarted']:.3g}")
        rows.append(f"| {' | '.join(cells)} |")
    heads = " | ".join(f"{title}: untouched | given | then" for title, _ in QUANTITIES.values())
    return table(f"| | {heads} | bending, from another start |", rows)


def distances() -> str:
    """Distances [mm] between engines at the end of a case, and of ours from itself."""
    found, rows = measured("engines"), []
    groups = [group for group in GROUPS if chosen(found, group)]
    cases = list(found["cases"])
    titles = {name: own["title"] for name, own in found["engines"].items()}
    for pair, values in found["between"].items():
        cells = [last(values, chosen(found, group)) for group in groups]
        names = ", ".join(titles[name] for name in pair.split())
        rows.append(_row(names, [*cells, last(values, cases)]))
    for title, key in (
        ("**all pairs of engines**", "between_all"),
        ("**ours, all pairs**", "own_all"),
    ):
        cells = [last(found[key], chosen(found, group)) for group in groups]
        rows.append(_row(title, [*cells, last(found[key], cases)]))
    ratios = [
        last(found["between_all"], some) / last(found["own_all"], some)
        for some in (*(chosen(found, group) for group in groups), cases)
    ]
    rows.append(f"| **ratio** | {' | '.join(f'**{ratio:.1f}**' for ratio in ratios)} |")
    heads = [f"{group} ({len(chosen(found, group))})" for group in groups]
    return table(f"| | {' | '.join(heads)} | all |", rows)


def moments() -> str:
    """Spreads [mm] at the moments of picking and placing, and their ratios."""
    found, rows = measured("engines"), []
    for group in ("flat", "folded"):
        cases = chosen(found, group)
        for moment in PLACED:
            engines, own = (
                root_mean_square(
                    found[key][case][found["cases"][case].index(moment)] for case in cases
                )
                for key in ("between_all", "own_all")
            )
            rows.append(f"| {group} | {moment} | {engines:.1f} | {own:.1f} | {engines / own:.1f} |")
    return table("| | end of | engines [mm] | ours [mm] | ratio |", rows)


def own_changes() -> str:
    """By how much [mm] each change of ours moves the end of a case."""
    found, rows = measured("engines"), []
    groups = [group for group in GROUPS if chosen(found, group)]
    for change, values in found["own"].items():
        cells = [last(values, chosen(found, group)) for group in groups]
        rows.append(_row(change.replace("_", " "), cells))
    return table(f"| ours with | {' | '.join(groups)} |", rows)


def costs() -> str:
    """CPU time, strain, penetration and intersections of each engine, over the cases compared."""
    found, rows = measured("engines"), []
    for name, runs in found["runs"].items():
        own = [runs[case] for case in found["cases"]]
        milliseconds = statistics.fmean(run["milliseconds"] for run in own)
        hits = sum(run["intersections"][-1] for run in own)
        cells = [
            f"{milliseconds:.1f}",
            f"{10.0 / milliseconds:.2g}",
            f"{100 * max(run['strain_99'] for run in own):.1f}",
            f"{1e3 * min(run['lowest'] for run in own):.1f}",
            str(hits),
            str(sum(bool(run["failed"]) for run in own)),
        ]
        rows.append(f"| {found['engines'][name]['title']} | {' | '.join(cells)} |")
    heads = (
        "CPU ms for 10 ms | times real time | p99 strain [%] | lowest vertex [mm] | "
        "intersections at the ends | cases with a failure"
    )
    return table(f"| | {heads} |", rows)


def number() -> str:
    """The one number."""
    found = measured("engines")
    cases = list(found["cases"])
    engines, own = (last(found[key], cases) for key in ("between_all", "own_all"))
    return (
        f"Between engines {engines:.0f} mm, own uncertainty {own:.0f} mm: **{engines / own:.1f}** "
        f"({len(cases)} cases, root mean squares over all pairs of "
        f"{len({name for pair in found['between'] for name in pair.split()})} engines, and of "
        f"{len(found['own']) + 1} runs of ours, at the ends). {_of_calibrated(found, own)}"
    )


def _of_calibrated(found: dict, own: float) -> str:
    """The same of the pairs of engines whose calibration reached all that it was to."""
    reached = [name for name in found["engines"] if _is_calibrated(found, name)]
    pairs = [pair for pair in found["between"] if set(pair.split()) <= set(reached)]
    apart = root_mean_square(last(found["between"][pair], found["cases"]) for pair in pairs)
    titles = " and ".join(found["engines"][name]["title"] for name in reached)
    return (
        f"Calibration reached all three numbers in {titles} only: between these {apart:.0f} mm, "
        f"**{apart / own:.1f}**."
    )


def _is_calibrated(found: dict, name: str) -> bool:
    """Whether an engine measures as the fabric, and bends so from another start, too."""
    calibration = found["calibration"][name]
    measured = {
        quantity: next(
            value for number, value in rounds if number == calibration["given"][quantity]
        )
        for quantity, rounds in calibration["measured"].items()
    }
    pairs = [(measured[quantity], found["fabric"][quantity]) for quantity in QUANTITIES]
    pairs.append((calibration["restarted"], measured["bend_stiffness"]))
    return all(abs(value / wanted - 1.0) <= _REACHED for value, wanted in pairs)


def demonstration() -> str:
    """Distances from the picker's cloth, and scores, of the rollouts."""
    rows = []
    for rollout, repeats in measured("demonstration")["rollouts"].items():
        for column, title in DEMONSTRATED.items():
            scores = [repeat[column]["score"] for repeat in repeats]
            held = sum(repeat[column]["held"] for repeat in repeats)
            cells = [f"{held} of {len(repeats)}"]
            for moment in PLACED:
                own = [r[column].get("distance_mm", {}).get(moment) for r in repeats]
                cells.append("" if own[0] is None else _mean_and_deviation(own, ".0f"))
            cells.append(_mean_and_deviation(scores, ".2f"))
            rows.append(f"| {rollout} | {title} | {' | '.join(cells)} |".replace("|  |", "| |"))
    heads = " | ".join(f"{moment} [mm]" for moment in PLACED)
    return table(f"| | | held | {heads} | normalised performance |", rows)


def _mean_and_deviation(values: list[float], form: str) -> str:
    return f"{statistics.fmean(values):{form}} ± {statistics.stdev(values):{form}}"


def _row(title: str, values: Iterable[float]) -> str:
    return f"| {title} | {' | '.join(f'{value:.1f}' for value in values)} |"


TABLES: dict[str, Callable[[], str]] = {
    "number": number,
    "calibration": calibration,
    "distances": distances,
    "moments": moments,
    "own": own_changes,
    "costs": costs,
    "demonstration": demonstration,
}


def draw() -> None:
    """The figure: sheets at one moment, a row for each case that is kept."""
    import matplotlib.pyplot as plt

    found = measured("engines")
    shown, titles = found["shown"], found["engines"]
    columns = max(len(own) for own in shown.values())
    figure, grid = plt.subplots(
        len(shown), columns, figsize=(3.0 * columns, 2.9 * len(shown)), squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for row, (case, sheets) in zip(grid, shown.items(), strict=True):
        points = {name: np.array(own) for name, own in sheets.items()}
        every = np.concatenate([*points.values()])
        middle = (every.min(axis=0) + every.max(axis=0)) / 2.0
        camera = camera_at(middle + _CAMERA, middle, _SIZE, _FIELD_OF_VIEW)
        painter = Painter.of(SHEET.points, SHEET.triangles, camera, _SIZE, 0.0, _DOTS)
        for axes, (name, own) in zip(row, points.items(), strict=False):
            axes.imshow(painter.sheet(own))
            axes.set_axis_off()
            apart = 1e3 * math.sqrt(((own - points["ours"]) ** 2).sum(axis=1).mean())
            beside = "" if name == "ours" else f": {apart:.0f} mm from ours"
            shown_case = f"{case.replace('_', ' ')}{beside}"
            axes.set_title(f"{titles[name]['title']}\n{shown_case}", fontsize="small")
    figure.savefig(FIGURE, dpi=100)
    plt.close(figure)
