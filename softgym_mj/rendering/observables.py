"""What cameras see as observables: colours, distances, labels, points."""

import contextlib
import contextvars
import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import mujoco
import numpy as np
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj.native.arithmetic import product
from softgym_mj.rendering.offscreen import GLASS_GROUP, CameraView

WRIST_RGB = "wrist_rgb"  # uint8 (arms, height, width, 3): from the cameras on the hands of arms.
LABELS = ("background", "object", "actor", "container")
NUM_CLOUD_POINTS = 1024
_blank = contextvars.ContextVar("blank", default=False)
EDGE_DEPTH = 0.01  # [m] By which the depth of a point of the cloud may differ from its neighbours'.
LAYER_DEPTH = 0.5  # [m] By which it may lie behind the nearest: two pixels of the sky would agree.


class TaskCamera:
    """What the task's camera sees, as colours, distances, labels and points; no marks of goals.

    Labels and points have what is behind glass; colours show it, and distances are of the glass.
    """

    def __init__(self, height: int, width: int, parts: Callable[[], Mapping[str, Sequence[str]]]):
        """Binds the camera.

        Args:
            height, width: of images [pixels].
            parts: gives the names of the models that make up each of the `LABELS`; whatever
                deforms or flows is "object", everything else "background".
        """
        self._view = CameraView("task", height, width, marks=False)
        self._behind_glass = CameraView("task", height, width, marks=False, glass=False)
        self._height, self._width, self._parts = height, width, parts
        self._model: mujoco.MjModel | None = None
        self._labels, self._has_glass = np.zeros(0, np.uint8), False

    def observables(self) -> dict[str, observable.Generic]:
        """The observables by name."""
        view, image = self._view, (self._height, self._width)
        colors = specs.BoundedArray((*image, 3), np.uint8, 0, 255)
        labels = specs.BoundedArray(image, np.uint8, 0, len(LABELS) - 1)
        cloud = specs.Array((NUM_CLOUD_POINTS, 4), np.float32)
        return {
            "rgb": CameraObservable(view.rgb, colors),
            "depth": CameraObservable(view.depth, specs.Array(image, np.float32)),
            "segmentation": CameraObservable(self.segmentation, labels),
            "point_cloud": CameraObservable(self.point_cloud, cloud),
        }

    def segmentation(self, physics) -> np.ndarray:
        """Index into `LABELS` (height, width) uint8 of what each pixel shows.

        Where an object is behind glass it is the object, else what has walls of glass.
        """
        self._read(physics.model.ptr)
        labels = self._labelled(self._view, physics)
        if self._has_glass:
            behind = self._labelled(self._behind_glass, physics)
            glass = labels == LABELS.index("container")
            labels[glass & (behind == LABELS.index("object"))] = LABELS.index("object")
        return labels

    def _read(self, model: mujoco.MjModel) -> None:
        """Notes what is what in a model."""
        if model is not self._model:
            self._model = model
            owners = {
                name: i for i, label in enumerate(LABELS) for name in self._parts().get(label, ())
            }
            self._labels = np.array(
                [_label(model.body(body).name, owners) for body in model.geom_bodyid], np.uint8
            )
            self._has_glass = bool(np.any(model.geom_group == GLASS_GROUP))

    def _labelled(self, view: CameraView, physics) -> np.ndarray:
        """Index into `LABELS` of the first thing that a view shows in each pixel."""
        seen = view.segmentation(physics)
        kind, index = seen[..., 1], seen[..., 0]
        labels = np.where(kind >= 0, LABELS.index("object"), 0).astype(np.uint8)
        geoms = kind == mujoco.mjtObj.mjOBJ_GEOM
        labels[geoms] = self._labels[index[geoms]]
        return labels

    def point_cloud(self, physics) -> np.ndarray:
        """Points of the object that are seen (1024, 4) float32: x, y, z [m] and 1, or zeros.

        If there are more, they are taken evenly from the pixels in reading order.
        """
        shown = self.segmentation(physics) == LABELS.index("object")
        view = self._behind_glass if self._has_glass else self._view
        image = np.where(shown, view.depth(physics), np.nan)
        rows, columns = np.nonzero(shown)
        depth = image[rows, columns].astype(float)
        # Where the object ends, a pixel may have the label of one surface and the depth of another.
        around = _neighbours(image, rows, columns)
        sure = np.abs(depth - np.nanmedian(around, axis=0)) < EDGE_DEPTH
        sure &= depth - np.nanmin(around, axis=0) < LAYER_DEPTH
        rows, columns, depth = rows[sure], columns[sure], depth[sure]
        model, data = physics.model.ptr, physics.data.ptr
        camera = model.camera("task").id
        pitch = 2.0 * math.tan(math.radians(model.cam_fovy[camera]) / 2) / self._height
        right = (columns + 0.5 - self._width / 2) * pitch * depth
        up = (self._height / 2 - rows - 0.5) * pitch * depth
        local = np.column_stack([right, up, -depth])
        points = data.cam_xpos[camera] + product(local, data.cam_xmat[camera].reshape(3, 3).T)
        if len(points) > NUM_CLOUD_POINTS:
            points = points[np.linspace(0, len(points) - 1, NUM_CLOUD_POINTS).astype(int)]
        cloud = np.zeros((NUM_CLOUD_POINTS, 4), np.float32)
        cloud[: len(points), :3] = points
        cloud[: len(points), 3] = 1.0
        return cloud


def wrist_observables(
    cameras: Sequence[str], height: int, width: int
) -> dict[str, observable.Observable]:
    """The observable of what the cameras on hands see, by name; none without such cameras.

    Args:
        cameras: their names, as `Actor.wrists` has them.
        height, width: of images [pixels].
    """
    if not cameras:
        return {}
    views = [CameraView(camera, height, width, marks=False) for camera in cameras]
    spec = specs.BoundedArray((len(views), height, width, 3), np.uint8, 0, 255)
    return {
        WRIST_RGB: CameraObservable(lambda physics: np.array([v.rgb(physics) for v in views]), spec)
    }


def _label(body: str, owners: Mapping[str, int]) -> int:
    """The label of a body: that of the innermost model around it that has one."""
    models = reversed(body.split("/")[:-1])
    return next((owners[model] for model in models if model in owners), 0)


def _neighbours(image: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Pixels (9, n) of the 3 x 3 around each of n; NaN beyond the image."""
    padded = np.pad(image, 1, constant_values=np.nan)
    return np.array([padded[rows + i, columns + j] for i in range(3) for j in range(3)])


@contextlib.contextmanager
def blank_images() -> Iterator[None]:
    """Images are zeros inside.

    dm_control evaluates all observations when it compiles a model and throws them away. A process
    that has rendered can no longer be forked: one that has only made an environment should.
    """
    token = _blank.set(True)
    try:
        yield
    finally:
        _blank.reset(token)


class CameraObservable(observable.Generic):
    """An observable with a given specification: without one, it would be rendered to find out."""

    def __init__(self, look: Callable, spec: specs.Array):
        self._spec = spec
        zeros = functools.partial(np.zeros, spec.shape, spec.dtype)
        super().__init__(lambda physics: zeros() if _blank.get() else look(physics))

    @property
    def array_spec(self) -> specs.Array:
        return self._spec
