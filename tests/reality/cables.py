"""Writes recordings of cables in the layout of the published ones."""

import pathlib
import pickle

import numpy as np

FRAMES, MARKERS, LENGTH = 30, 8, 0.8


def swinging(frames: int = FRAMES, markers: int = MARKERS) -> np.ndarray:
    """Returns markers (frames, markers, 3) [m] of a hanging arc that is moved along Y."""
    angles = np.linspace(-1.0, 1.0, markers)
    radius = LENGTH / 2.0
    arc = np.stack([radius * np.sin(angles), 0.0 * angles, 1.0 - radius * np.cos(angles)], axis=1)
    moved = np.repeat(arc[None], frames, axis=0)
    moved[:, :, 1] += 0.1 * np.sin(np.arange(frames) * 0.1)[:, None]
    return moved


def write(folder: pathlib.Path, cable: str, split: str, name: str, markers: np.ndarray) -> None:
    """Writes markers (f, n, 3) [m] as nested lists, frame by axis by marker."""
    target = folder / cable / split
    target.mkdir(parents=True, exist_ok=True)
    lists = markers.transpose(0, 2, 1).tolist()
    (target / f"{name}.pkl").write_bytes(pickle.dumps(lists))
