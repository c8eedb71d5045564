"""Camera observables: colors, depths, labels and point clouds."""

import contextlib
import contextvars
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence

import mujoco
import numpy as np
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj.rendering import point_clouds
from softgym_mj.rendering.offscreen import GLASS_GROUP, CameraView

EXTERNAL = ("left", "right")  # Names of the depth cameras beside the scene.
EXTERNAL_RGB = "external_rgb"  # uint8 (2, height, width, 3): from those cameras.
WRIST_RGB = "wrist_rgb"  # uint8 (arms, height, width, 3): from the cameras on the hands of arms.
LABELS = ("background", "object", "actor", "container")
_GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)  # Comparing an array with the enum itself is slow.
_blank = contextvars.ContextVar("blank", default=False)


class LabeledView(CameraView):
    """Camera with object labels; labels, depths and point clouds never contain goal marks.

    Labels and point clouds include objects behind glass; depths are those of the glass.
    """

    def __init__(
        self, camera: str, height: int, width: int, parts: Callable[[], Mapping[str, Sequence[str]]]
    ):
        """Chooses the camera.

        Args:
            camera, height, width: As in `CameraView`.
            parts: Returns the names of the models of each of the `LABELS`; everything that deforms
                or flows is "object", all other models are "background".
        """
        super().__init__(camera, height, width, marks=False)
        self._behind_glass = CameraView(camera, height, width, marks=False, glass=False)
        self._parts = parts
        self._model: mujoco.MjModel | None = None
        self._labels, self._has_glass = np.zeros(0, np.uint8), False

    def labels(self, physics) -> np.ndarray:
        """Renders labels: index into `LABELS` of each pixel (height, width) uint8."""
        return self._labeled(physics)[0]

    def points(self, physics) -> np.ndarray:
        """Returns points (n, 3) [m] of the object, one for each pixel that shows it."""
        labels, depth = self._labeled(physics)
        shown = labels == LABELS.index("object")
        return point_clouds.seen_points(depth, shown, self.calibration(physics))

    def surfaces(self, physics) -> tuple[np.ndarray, np.ndarray]:
        """Renders segmentation and depth of one pass, without goal marks."""
        return self._surfaces(physics, marks=False)

    def _labeled(self, physics) -> tuple[np.ndarray, np.ndarray]:
        """Renders labels and depths [m] (height, width) of objects, also of those behind glass."""
        self._read(physics.model.ptr)
        labels, depth = self._first(self, physics)
        if not self._has_glass:
            return labels, depth
        behind, further = self._first(self._behind_glass, physics)
        through = (labels == LABELS.index("container")) & (behind == LABELS.index("object"))
        return np.where(through, behind, labels), np.where(through, further, depth)

    def _read(self, model: mujoco.MjModel) -> None:
        """Reads which geoms, skins and flexes of a model have which label."""
        if model is not self._model:
            self._model = model
            self._labels = geom_labels(model, self._parts())
            self._has_glass = bool(np.any(model.geom_group == GLASS_GROUP))

    def _first(self, view: CameraView, physics) -> tuple[np.ndarray, np.ndarray]:
        """Returns label and depth of the frontmost geom of each pixel."""
        seen, depth = view.surfaces(physics)
        kind, index = seen[..., 1], seen[..., 0]
        labels = np.where(kind >= 0, LABELS.index("object"), 0).astype(np.uint8)
        geoms = kind == _GEOM
        labels[geoms] = self._labels[index[geoms]]
        return labels, depth


def fixed_observables(
    height: int, width: int, parts: Callable[[], Mapping[str, Sequence[str]]]
) -> dict[str, observable.Generic]:
    """Returns the observables of the arena's cameras by name.

    Args:
        height, width: Size of images [pixels].
        parts: As in `LabeledView`.
    """
    task, *pair = (LabeledView(name, height, width, parts) for name in ("task", *EXTERNAL))
    image = height, width
    colors = specs.BoundedArray((*image, 3), np.uint8, 0, 255)
    labels = specs.BoundedArray(image, np.uint8, 0, len(LABELS) - 1)
    cloud = specs.Array((point_clouds.NUM_CLOUD_POINTS, 4), np.float32)
    return {
        "rgb": CameraObservable([task], task.rgb, colors),
        "depth": CameraObservable([task], task.depth, specs.Array(image, np.float32)),
        "segmentation": CameraObservable([task], task.labels, labels),
        EXTERNAL_RGB: _colors_of(pair),
        "external_depth": CameraObservable(
            pair,
            lambda physics: np.array([view.depth(physics) for view in pair]),
            specs.Array((len(pair), *image), np.float32),
        ),
        "point_cloud": CameraObservable(
            pair,
            lambda physics: point_clouds.cloud(
                np.concatenate([view.points(physics) for view in pair])
            ),
            cloud,
        ),
    }


def wrist_observables(
    cameras: Sequence[str], height: int, width: int
) -> dict[str, observable.Observable]:
    """Returns the observable of the wrist cameras by name; empty without such cameras.

    Args:
        cameras: Names from `Actor.wrists`.
        height, width: Size of images [pixels].
    """
    views = [CameraView(camera, height, width, marks=False) for camera in cameras]
    return {WRIST_RGB: _colors_of(views)} if views else {}


def geom_labels(model: mujoco.MjModel, parts: Mapping[str, Sequence[str]]) -> np.ndarray:
    """Returns the index into `LABELS` of each geom (ngeom,) uint8; `parts` as in `LabeledView`."""
    owners = {name: i for i, label in enumerate(LABELS) for name in parts.get(label, ())}
    return np.array([_label(model.body(body).name, owners) for body in model.geom_bodyid], np.uint8)


def _label(body: str, owners: Mapping[str, int]) -> int:
    """Returns the label of the innermost labeled model that contains a body."""
    models = reversed(body.split("/")[:-1])
    return next((owners[model] for model in models if model in owners), 0)


@contextlib.contextmanager
def blank_images() -> Iterator[None]:
    """Context in which image observations are zeros instead of rendered.

    dm_control evaluates and discards all observations when it compiles a model. A process that has
    rendered cannot be forked, but one that has only made an environment can.
    """
    token = _blank.set(True)
    try:
        yield
    finally:
        _blank.reset(token)


class CameraObservable(observable.Generic):
    """Image observable with a given specification, so that it need not be rendered to get one.

    Attributes:
        views: Views of its cameras.
    """

    def __init__(self, views: Sequence[CameraView], look: Callable, spec: specs.Array):
        self.views, self._spec = tuple(views), spec
        zeros = functools.partial(np.zeros, spec.shape, spec.dtype)
        super().__init__(lambda physics: zeros() if _blank.get() else look(physics))

    @property
    def array_spec(self) -> specs.Array:
        return self._spec


def _colors_of(views: Sequence[CameraView]) -> CameraObservable:
    """Returns the images of several cameras (cameras, height, width, 3) uint8."""
    spec = specs.BoundedArray((len(views), *views[0].size, 3), np.uint8, 0, 255)
    return CameraObservable(
        views, lambda physics: np.array([view.rgb(physics) for view in views]), spec
    )
