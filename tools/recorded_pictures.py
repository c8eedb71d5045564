"""Films and curves of docs/reality.md: recorded and simulated cables, cloth and water.

    python -m tools.recorded_pictures --rope data_set --cloth DIR --water DIR

Folders are those of `softgym-mj validate`. Properties are those in docs/*_recordings.json. It
writes docs/renders/rope-recorded.webp and cloth-recorded.webp (the recording with the median error
of each cable and of the cloth; recorded on the left or above), docs/rope_errors.png and
docs/water_curves.png, in three minutes on one core. Matplotlib is part of the extra `plot`.
"""

import argparse
import json
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.interpolate import CubicSpline

from softgym_mj.reality.cloth import experiment as cloth_experiment
from softgym_mj.reality.cloth.recordings import read_recordings as read_cloths
from softgym_mj.reality.cloth.scenario import grip_of
from softgym_mj.reality.cloth.scenario import scenario_of as cloth_scenario
from softgym_mj.reality.cloth.simulation import ClothSolver
from softgym_mj.reality.cloth.simulation import Properties as ClothProperties
from softgym_mj.reality.fitting import read_identified
from softgym_mj.reality.rope.cable import Properties as CableProperties
from softgym_mj.reality.rope.recordings import FRAME_TIME, HELD, read_recordings
from softgym_mj.reality.rope.scenario import START_FRAMES, EndsInterpolated, scenario_of
from softgym_mj.reality.rope.simulation import CableSolver
from softgym_mj.reality.water.comparison import EXPERIMENTS, PLAIN
from tools.videos import DOCS, write_video

SIZE, WIDE = 240, 4  # Side of a picture [pixels]; times as large while it is drawn.
SECOND = 12.5  # Pictures in a second of a film.
INK, FREE, GROUND = (25, 60, 140), (200, 60, 40), (250, 250, 248)
LABEL = 15  # [pixels]
# Experiments of the curves: particles over the depth, and names of the axes.
CURVES = {
    "koshizuka_oka": (32, "t √(2g/a)", "front / a"),
    "martin_moyce_57": (32, "t √(2g/a)", "front / a"),
    "spheric_2": (20, "t [s]", "height [m]"),
    "faltinsen": (24, "t [s]", "elevation [m]"),
}
GAUGES = {"spheric_2": ("H1", "H2")}
FEW = 60  # Positions up to which a recording is drawn as points.
TITLES = {
    "koshizuka_oka": "Dam break, Koshizuka and Oka",
    "martin_moyce_57": "Dam break, Martin and Moyce",
    "spheric_2": "Obstacle, SPHERIC 2",
    "faltinsen": "Sloshing, Faltinsen",
}


def projected(points: np.ndarray) -> np.ndarray:
    """Returns points (..., 2) [m], right and up, of points (..., 3) [m] seen from beside above."""
    # From 35 degrees to the side and 20 degrees above.
    side, lift = np.radians([35.0, 20.0])
    x, y, z = np.moveaxis(points, -1, 0)
    right, ahead = np.cos(side) * x + np.sin(side) * y, np.cos(side) * y - np.sin(side) * x
    return np.stack([right, np.cos(lift) * z + np.sin(lift) * ahead], axis=-1)


class Canvas:
    """Pictures of points in one frame, which all of them fit."""

    def __init__(self, motions: Sequence[np.ndarray]):
        """Finds the frame of motions (f, ..., 3) [m]."""
        flat = np.concatenate([projected(motion).reshape(-1, 2) for motion in motions])
        low, high = flat.min(axis=0), flat.max(axis=0)
        self._middle, self._scale = (low + high) / 2, 0.84 * SIZE * WIDE / (high - low).max()

    def draw(self, lines: Sequence[np.ndarray], dots: Sequence[np.ndarray], name: str):
        """Returns an image of polylines (n, 3) and of dots (n, 3) [m], each darker than before."""
        picture = Image.new("RGB", (SIZE * WIDE,) * 2, GROUND)
        pen = ImageDraw.Draw(picture)
        for line in lines:
            pen.line([tuple(p) for p in self._pixels(line)], INK, 2 * WIDE, joint="curve")
        for x, y in (p for dot in dots for p in self._pixels(dot)):
            pen.ellipse((x - 3 * WIDE, y - 3 * WIDE, x + 3 * WIDE, y + 3 * WIDE), FREE)
        picture = picture.resize((SIZE, SIZE), Image.Resampling.LANCZOS)
        ImageDraw.Draw(picture).text((6, 5), name, (90, 90, 90), ImageFont.load_default(LABEL))
        return np.asarray(picture)

    def _pixels(self, points: np.ndarray) -> np.ndarray:
        off = (projected(points) - self._middle) * self._scale
        return SIZE * WIDE / 2 + off * [1.0, -1.0]


def smooth(markers: np.ndarray) -> np.ndarray:
    """Returns points (n, 3) [m] of a spline through markers (m, 3) [m]."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(markers, axis=0), axis=1)))
    return CubicSpline(along, markers)(np.linspace(0.0, along[-1], 8 * len(markers)))


def median(errors: Sequence[float]) -> int:
    """Returns the index of the median error, the lower one of two."""
    return int(np.argsort(errors)[(len(errors) - 1) // 2])


def rope(folder: pathlib.Path) -> None:
    """Draws the film of cables, and the error over time of all."""
    entries = json.loads((DOCS / "rope_recordings.json").read_text())["identified"]
    columns, curves = [], {}
    for name, entry in entries.items():
        found, own = read_identified(CableProperties, entry), read_recordings(folder, name, "eval")
        solver = CableSolver("identified", np.array(found.spacing), found.properties)
        moved = [solver.predict(scenario_of(recording)) for recording in own]
        real = [recording.markers[START_FRAMES:] for recording in own]
        ends = [EndsInterpolated().predict(scenario_of(recording)) for recording in own]
        off = [np.abs(a - b).mean(axis=(1, 2)) for a, b in zip(moved, real, strict=True)]
        other = [np.abs(a - b).mean(axis=(1, 2)) for a, b in zip(ends, real, strict=True)]
        curves[name] = np.mean(off, axis=0), np.mean(other, axis=0)
        chosen = median([float(o.mean()) for o in off])
        columns.append((name, real[chosen], moved[chosen]))
    step = round(1.0 / SECOND / FRAME_TIME)
    rows: list[list[list[np.ndarray]]] = [[], []]
    for name, real, moved in columns:
        canvas = Canvas([real, moved])
        for row, motion, title in ((0, real, f"{name}, recorded"), (1, moved, "simulated")):
            shown = motion[::step]
            rows[row].append([canvas.draw([smooth(m)], [m[list(HELD)]], title) for m in shown])
    frames = [
        np.vstack([np.hstack(row) for row in pictures])
        for pictures in zip(*(zip(*row, strict=True) for row in rows), strict=True)
    ]
    write_video(frames, round(1e3 / SECOND), DOCS / "renders" / "rope-recorded.webp")
    figure, axes = _plots(1, 2)
    for name, pair in curves.items():
        times = FRAME_TIME * np.arange(len(pair[0]))
        for axis, curve in zip(axes, pair, strict=True):
            axis.plot(times, 1e3 * curve, label=name)
    for axis, title in zip(axes, ("Rope, identified", "Displacement of the ends"), strict=True):
        axis.set(title=title, xlabel="t [s]", ylabel="mean error [mm]", ylim=(0, 60))
    axes[0].legend(frameon=False, ncols=2)
    figure.savefig(DOCS / "rope_errors.png", dpi=110)


def cloth(folder: pathlib.Path) -> None:
    """Draws the film of the cloth."""
    entry = json.loads((DOCS / "cloth_recordings.json").read_text())["identified"]
    first, test = cloth_experiment.split(read_cloths(folder))
    grip, found = grip_of(first), read_identified(ClothProperties, entry)
    solver = ClothSolver("identified", grip, found.properties)
    runs = []
    for recording in test:
        scenario, nodes = cloth_scenario(recording, grip)
        moved = solver.predict(scenario)
        error = float(np.linalg.norm(moved - nodes, axis=-1).mean())
        runs.append((error, scenario.times, nodes, moved))
    _, times, nodes, moved = runs[median([run[0] for run in runs])]
    shown = np.searchsorted(times, np.arange(times[0], times[-1], 1.0 / SECOND))
    shown = shown[np.append(True, np.diff(shown) > 0)]
    canvas = Canvas([nodes, moved])

    def drawn(grid: np.ndarray, title: str) -> np.ndarray:
        lines = [*grid, *grid.swapaxes(0, 1)]
        return canvas.draw(lines, [grid[:, 0]], title)

    frames = [
        np.hstack([drawn(nodes[i], "cloth, recorded"), drawn(moved[i], "simulated")]) for i in shown
    ]
    write_video(frames, round(1e3 / SECOND), DOCS / "renders" / "cloth-recorded.webp")


def water(folder: pathlib.Path) -> None:
    """Draws curves of water."""
    figure, axes = _plots(2, 2)
    for name, axis in zip(CURVES, axes.ravel(), strict=True):
        cells, across, up = CURVES[name]
        experiment = EXPERIMENTS[name]
        recording = experiment.read(folder)
        until = float(recording.times[-1])
        run = experiment.simulate(PLAIN, experiment.depth / cells, until)
        names = GAUGES.get(name, ("",))
        for k, (gauge, style) in enumerate(zip(names, ("-", "--"), strict=False)):
            real, own = (
                each.values.reshape(len(each.times), -1)[:, k] for each in (recording, run)
            )
            mark = "o" if len(recording.times) < FEW else style
            axis.plot(recording.times, real, mark, color="0.45", ms=4, label=f"{gauge} recorded")
            axis.plot(run.times, own, style, color=f"C{k}", label=f"{gauge} simulated")
        axis.set_xlim(0.0, 1.02 * recording.times[-1])
        axis.set(title=f"{TITLES[name]}, {cells} cells", xlabel=across, ylabel=up)
        axis.legend(frameon=False)
    figure.savefig(DOCS / "water_curves.png", dpi=110)


def _plots(rows: int, columns: int) -> tuple[Any, Any]:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, figsize=(9.0, 3.2 * rows), layout="constrained")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    drawn: dict[str, Callable[[pathlib.Path], None]] = {
        "rope": rope, "cloth": cloth, "water": water,
    }  # fmt: skip
    for name in drawn:
        parser.add_argument(f"--{name}", type=pathlib.Path, metavar="DIR")
    for name, folder in vars(parser.parse_args(arguments)).items():
        if folder is not None:
            drawn[name](folder)


if __name__ == "__main__":
    main()
