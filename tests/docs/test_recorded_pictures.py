"""Pictures of recorded and simulated motion: where points are drawn, and which recording."""

import numpy as np

from tools.recorded_pictures import SIZE, Canvas, median, projected, smooth


def test_a_view_keeps_heights_and_shortens_depth():
    up, right = projected(np.array([[0.0, 0.0, 1.0], [np.cos(0.61087), np.sin(0.61087), 0.0]]))
    np.testing.assert_allclose(up, [0.0, np.cos(np.radians(20.0))], atol=1e-9)
    np.testing.assert_allclose(right, [1.0, 0.0], atol=1e-5)


def test_the_highest_point_is_drawn_at_the_top_of_the_frame():
    heights = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    picture = Canvas([heights]).draw([], [heights[1:]], "").astype(int)
    red = (picture[..., 0] - picture[..., 2] > 100).nonzero()
    assert abs(red[0].mean() - 0.08 * SIZE) < 1.0 and abs(red[1].mean() - SIZE / 2) < 1.0


def test_a_spline_of_points_on_a_line_is_that_line():
    line = np.linspace([0.0, 0.0, 0.0], [1.0, 2.0, 3.0], 6)
    np.testing.assert_allclose(smooth(line)[:, 1], 2.0 * smooth(line)[:, 0], atol=1e-12)


def test_the_median_of_an_even_number_is_the_lower_one():
    assert median([3.0, 1.0, 2.0, 9.0]) == 2 and median([5.0]) == 0
