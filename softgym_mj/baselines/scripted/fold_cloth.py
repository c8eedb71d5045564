"""The expert of FoldCloth: takes the corners of column 0 and swings them over to their mirrors."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.baselines.scripted.cloth_expert import LAYER, ClothExpert
from softgym_mj.baselines.scripted.picker_expert import OPEN

SHORT = 0.02  # [m] By which the corners are let down early: the bend takes up as much.


class FoldCloth(ClothExpert):
    """Takes two corners, carries them over in a half circle and lays them down."""

    def _episode(self) -> Iterator[np.ndarray]:
        cloth, grips = self._env.task.cloth, [False, False]
        p1, p2, p3, p4 = cloth.corners.tolist()
        mirror = {p1: p3, p2: p4}
        wanted = self._matched([p1, p2])
        yield from self._take(dict(enumerate(wanted)), grips)
        ends = np.array([cloth.vertex(mirror[v]) for v in wanted])
        ways = ends - [cloth.vertex(v) for v in wanted]
        ends -= SHORT * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        yield from self._swing(ends + [0.0, 0.0, LAYER])
        while True:
            yield self._rest(OPEN)
