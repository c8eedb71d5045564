"""The README's moving pictures: all tasks, small files, cut where nothing moves any more."""

import numpy as np
import pytest
from PIL import Image

from softgym_mj.registry import TASKS
from tools import gifs

LARGEST, ALL = 250e3, 2e6  # Of a file, and of all of them [bytes].


def moving_dot(n, still):
    """A dot on grey that moves by two pixels a picture, then stands still."""
    frames = np.full((n + still, 60, 60, 3), 128, np.uint8)
    for i, frame in enumerate(frames):
        x = 2 * min(i, n - 1)
        frame[20:30, x : x + 8] = (200, 30, 30)
    return frames


def test_every_task_has_a_small_moving_picture():
    files = {file.stem: file for file in gifs.FOLDER.glob("*.gif")}
    assert set(files) == set(TASKS)
    sizes = [file.stat().st_size for file in files.values()]
    assert max(sizes) < LARGEST and sum(sizes) < ALL
    for file in files.values():
        with Image.open(file) as picture:
            assert picture.size == (gifs.SIZE, gifs.SIZE)
            assert picture.n_frames > 20 and picture.info["loop"] == 0


def test_it_ends_when_nothing_moves_any_more():
    frames = moving_dot(10, still=30)
    assert len(gifs.until_rest(frames)) == 9 + gifs.REST  # The tenth is as all that follow.
    assert len(gifs.until_rest(frames[:10])) == 10


def test_pictures_are_means_of_squares():
    small = gifs.smaller(moving_dot(1, still=0))
    assert small.shape == (1, 20, 20, 3)
    assert small[0, 8, 1].tolist() == [200, 30, 30] and small[0, 0, 0].tolist() == [128] * 3
    # Two of three columns are of the dot.
    assert small[0, 8, 2] == pytest.approx([176, 62.7, 62.7], abs=0.5)


def test_a_gif_shows_its_pictures(tmp_path):
    frames = moving_dot(10, still=0)
    gifs.write_gif(frames, 80, tmp_path / "dot.gif")
    with Image.open(tmp_path / "dot.gif") as picture:
        durations = []
        for i, frame in enumerate(frames):
            picture.seek(i)
            durations.append(picture.info["duration"])
            assert np.abs(np.asarray(picture.convert("RGB")).astype(int) - frame).max() < 16
    assert durations == [80] * 9 + [gifs.HOLD]
