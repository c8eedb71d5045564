"""Films of cases, recording and replay beside each other, and curves of their distances."""

import io
import pathlib
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import import_extra
from softgym_mj.jobs.files import write_whole
from softgym_mj.reality.pictures import Painter, beside, camera_at
from softgym_mj.reality.validation.cases import PERSISTENCE, REAL, SURFACE, Case
from softgym_mj.rendering.offscreen import Video

SIZE = (360, 360)  # [pixels] Of each half of a film.
_FIELD_OF_VIEW = 40.0  # [deg]
_FROM = np.array([0.55, 0.75, 0.35])  # Direction from the middle to where it is looked from.
_MARGIN = 1.25
_DPI = 120


def film(case: Case, floor: float | None) -> Video:
    """The recorded cloud on the left, what was simulated on the right, in real time.

    Args:
        case: with finite positions in its first frame.
        floor: height [m] of the ground that is drawn; None for none.
    """
    painter = _painter(case, floor)
    frames = []
    for i, cloud in enumerate(case.clouds):
        colors = None if case.colors is None else case.colors[i]
        there = np.isfinite(case.positions[i]).all()
        places = case.positions[i] if there else np.full_like(case.positions[i], 1e3)
        held = places[list(case.held)] if there else None
        frames.append(beside([painter.cloud(cloud, colors), painter.sheet(places, held)]))
    rate = 1.0 / float(np.median(np.diff(case.times))) if len(case.times) > 1 else 1.0
    return Video(np.stack(frames), rate)


def curves(cases: Sequence[Case], primary: str, file: pathlib.Path) -> None:
    """Draws the primary distance over time, a panel for each group, and what it is compared with.

    Raises:
        UnavailableError: without Matplotlib.
        StoreError: if the file cannot be written.
    """
    import_extra("matplotlib", "Matplotlib", "plot")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    groups = list(dict.fromkeys(case.group for case in cases))
    figure = Figure(figsize=(6.4, 2.4 * len(groups)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(groups), 1, squeeze=False)
    lines = {
        primary: ("simulated vertices", "C3", "-"),
        f"{SURFACE}{primary}": ("simulated surface", "C1", "-"),
        f"{REAL}{primary}": ("another repeat", "C0", "--"),
        f"{PERSISTENCE}{primary}": ("first frame held still", "0.5", ":"),
    }
    for axes, group in zip(grid[:, 0], groups, strict=True):
        members = [case for case in cases if case.group == group]
        for column, (label, color, style) in lines.items():
            for case in members:
                if column in case.columns:
                    name = label if case is members[0] else None
                    values = 1e3 * case.columns[column]
                    axes.plot(case.times, values, style, color=color, lw=1, label=name)
        last = max(case.times[case.counted].max(initial=0.0) for case in members)
        axes.axvline(last, color="0.8", lw=0.8)
        axes.set_title(group, fontsize="medium")
        axes.set_ylabel(f"{primary} [mm]")
        axes.set_ylim(bottom=0.0)
    grid[0, 0].legend(fontsize="small")
    grid[-1, 0].set_xlabel("time [s]")
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DPI)
    write_whole(file, content.getvalue())


def _painter(case: Case, floor: float | None) -> Painter:
    """A camera that has all of a case in view."""
    finite = case.positions[np.isfinite(case.positions).all(axis=(1, 2))].reshape(-1, 3)
    everything = np.concatenate([finite, *case.clouds])
    low, high = everything.min(axis=0), everything.max(axis=0)
    middle, radius = (low + high) / 2.0, np.linalg.norm(high - low) / 2.0
    away = _MARGIN * radius / np.sin(np.radians(_FIELD_OF_VIEW / 2.0))
    position = middle + away * _FROM / np.linalg.norm(_FROM)
    camera = camera_at(position, middle, SIZE, _FIELD_OF_VIEW)
    return Painter.of(case.mesh.points, case.mesh.triangles, camera, SIZE, floor)
