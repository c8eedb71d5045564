"""Students: networks that map stacked images and other observations to actions."""

import dataclasses
import itertools
from collections.abc import Mapping

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.frames import pictured
from softgym_mj.learning.methods.action_forms import ActionForm, Bins, Values
from softgym_mj.learning.point_encoder import Layout, PointEncoder
from softgym_mj.validation import typed

_LAYERS = ((5, 2), (3, 2), (3, 2), (3, 1))  # Kernel and stride of each convolution.
Observation = Mapping[str, Tensor]


@typed
@dataclasses.dataclass(frozen=True)
class StudentSettings:
    """Settings of a student.

    Attributes:
        privileged: name of the observation that the teacher takes, such as "markov"; "+" joins
            several, whose numbers follow each other.
        frames: number of successive images in an observation.
        channels: number of filters of each convolution.
        features: size of the encoding of the images.
        hidden: sizes of the layers behind it.
        symmetric: whether random symmetries of the task transform sampled steps, without images.
        shift: largest random shift of images in each direction, in updates [pixels].
        updates: number of updates in each step of all environments.
        batch: number of env steps in an update.
        buffer: number of newest env steps that are kept, of each seed.
        rate: largest learning rate; it falls linearly to zero.
        warm_up: number of steps of all environments over which it rises at first: large
            updates while all episodes start, with labels that are alike, saturate tanh for good.
        gradient_norm: largest norm of a gradient; larger ones are scaled.
        weight_decay: of AdamW.
        beta: error at which the smooth L1 loss changes from quadratic to linear.
        teacher_share: share of the environments in which the teacher acts at first.
        teacher_until: share of the training over which that falls to zero; None: it stays.
        noise: standard deviation of the noise on actions that are carried out.
        wild_noise: the same in an eighth of the environments, added to `noise`.
        bins: number of values of each action that the student tells apart: it gives each a
            probability and takes the highest peak; 0 for one number an action.
        points: whether attention over the object's points encodes the numbers; for students
            of `reduced`, `key_points` or `markov` and other numbers.

    Raises:
        InvalidArgumentError: for a number out of range.
    """

    privileged: str = "markov"
    frames: int = 2
    channels: int = 48
    features: int = 256
    hidden: tuple[int, ...] = (1024, 1024)
    symmetric: bool = False
    shift: int = 4
    updates: int = 8
    batch: int = 512
    buffer: int = 150_000
    rate: float = 5e-4
    warm_up: int = 20
    gradient_norm: float = 1.0
    weight_decay: float = 1e-2
    beta: float = 0.2
    teacher_share: float = 0.5
    teacher_until: float | None = 0.2
    noise: float = 0.05
    wild_noise: float = 0.3
    bins: int = 0
    points: bool = False

    def __post_init__(self):
        for name in ("frames", "channels", "features", "updates", "batch", "buffer", "warm_up"):
            check_count(name, getattr(self, name), 1)
        check_count("shift", self.shift, 0)
        if self.bins:
            check_count("bins", self.bins, 3)
        check_number("teacher_share", self.teacher_share, ge=0.0, le=1.0)
        if self.teacher_until is not None:
            check_number("teacher_until", self.teacher_until, ge=0.0, le=1.0)


class Student(nn.Module):
    """Actions of stacked observations.

    Attributes:
        frames: number of successive images in an observation.
        images: names of observations that are images, which must be of one size.
        others: names of all other observations.
        form: what its outputs mean.
    """

    def __init__(
        self,
        settings: StudentSettings,
        shapes: Mapping[str, tuple[int, ...]],
        action: int,
        layout: Layout | None = None,
    ):
        """Draws the weights from PyTorch's generator.

        Args:
            settings: sizes.
            shapes: of a single observation by name.
            action: size of an action.
            layout: where the points of the first observation are, with the setting `points`.

        Raises:
            InvalidArgumentError: for images that are too small.
        """
        super().__init__()
        self.frames = settings.frames
        self.images = [name for name, shape in shapes.items() if len(shape) > 1]
        self.others = [name for name, shape in shapes.items() if len(shape) == 1]
        examples = [pictured(torch.zeros(shapes[name])) for name in self.images]
        others = sum(shapes[name][0] for name in self.others)
        layers: list[nn.Module] = []
        if examples:
            sides = [*examples[0].shape[:2]]
            inputs = settings.frames * sum(example.shape[-1] for example in examples)
            for kernel, stride in _LAYERS:
                layers += [nn.Conv2d(inputs, settings.channels, kernel, stride), nn.ReLU()]
                inputs, sides = settings.channels, [(side - kernel) // stride + 1 for side in sides]
            if min(sides) < 1:
                raise InvalidArgumentError(
                    "observation", dict(shapes), "images of 35 pixels or more"
                )
            layers.append(nn.Flatten())
            encoded = inputs * sides[0] * sides[1]
        else:
            encoded = others
        self.encoder: nn.Module
        if layout is None:
            self.encoder = nn.Sequential(
                *layers, nn.Linear(encoded, settings.features),
                nn.LayerNorm(settings.features), nn.Tanh(),
            )  # fmt: skip
        else:
            self.encoder = PointEncoder(layout, others, settings.features)
        self.form: ActionForm = Bins(settings.bins) if settings.bins else Values(settings.beta)
        width = settings.features + others
        head: list[nn.Module] = []
        outputs = self.form.size(action)
        for size, following in itertools.pairwise((width, *settings.hidden, outputs)):
            head += [nn.Linear(size, following), nn.ReLU()]
        self.head = nn.Sequential(*head[:-1])

    def forward(self, observation: Observation) -> Tensor:
        """Returns actions (n, action) of the observations that `outputs` takes."""
        return self.form.chosen(self.outputs(observation))

    def outputs(self, observation: Observation) -> Tensor:
        """Returns the outputs (n, size), whose meaning is the form's.

        Args:
            observation: images (n, frames, ...), the oldest first, and other numbers (n, k).
        """
        seen = [
            frame.float() / 255.0 if frame.dtype == torch.uint8 else frame.float()
            for name in self.images
            for frame in pictured(observation[name], 2).unbind(1)
        ]
        others = [observation[name].float() for name in self.others]
        # Channels stay last.
        encoded = self.encoder(
            torch.cat(seen, -1).movedim(-1, 1) if seen else torch.cat(others, -1)
        )
        return self.head(torch.cat([encoded, *others], -1))
