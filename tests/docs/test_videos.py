"""The README's moving pictures: all tasks, small files, cut where nothing moves any more."""

import numpy as np
from PIL import Image

from tools import videos

LARGEST, ALL = 400e3, 4e6  # [bytes] Limits of a file, and of all files.


def moving_dot(n, still):
    """A dot on gray that moves by two pixels a picture, then stands still."""
    frames = np.full((n + still, 60, 60, 3), 128, np.uint8)
    for i, frame in enumerate(frames):
        x = 2 * min(i, n - 1)
        frame[20:30, x : x + 8] = (200, 30, 30)
    return frames


def test_every_task_has_a_small_moving_picture():
    files = {file.stem: file for file in videos.FOLDER.glob("*.webp")}
    with Image.open(files.pop("tasks")) as picture:
        assert picture.size == (videos.COLUMNS * videos.SIZE, 2 * videos.SIZE)
        assert picture.n_frames == videos.FRAMES
    assert set(files) == set(videos.names_of_all())
    sizes = [file.stat().st_size for file in files.values()]
    assert max(sizes) < LARGEST and sum(sizes) < ALL
    for file in files.values():
        with Image.open(file) as picture:
            assert picture.size == (videos.SIZE, videos.SIZE)
            # WebP joins equal pictures: of a drop, which is short, 20 are left.
            assert picture.n_frames >= 20 and picture.info["loop"] == 0


def test_it_ends_when_nothing_moves_any_more():
    frames = moving_dot(10, still=30)
    assert len(videos.until_rest(frames)) == 9 + videos.REST  # The tenth is as all that follow.
    assert len(videos.until_rest(frames[:10])) == 10


def test_a_video_shows_its_pictures(tmp_path):
    frames = moving_dot(10, still=0)
    videos.write_video(frames, 80, tmp_path / "dot.webp")
    with Image.open(tmp_path / "dot.webp") as picture:
        durations = []
        for i, frame in enumerate(frames):
            picture.seek(i)
            shown = np.asarray(picture.convert("RGB")).astype(int)
            durations.append(picture.info["duration"])
            assert np.abs(shown - frame).mean() < 4
    assert durations == [80] * 9 + [videos.HOLD]
