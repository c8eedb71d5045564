"""Distillation: an image policy imitates a state policy, for several seeds.

DAgger (Ross et al., 2011): the student acts, the teacher labels what the student meets, and the
student is fitted to the labels of the newest env steps.
"""

import copy
import dataclasses
import io
import itertools
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.export.passes import move_to_device_pass

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.frames import Frames, pictured, stacked
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.networks import StoredInHalf, drawn, generators
from softgym_mj.storage.files import read_whole
from softgym_mj.validation import typed

_LAYERS = ((5, 2), (3, 2), (3, 2), (3, 1))  # Kernel and stride of each convolution.
LABEL = "label"  # Beside observations: the teacher's action.
_NOISE_SEEDS = 1_000_003  # Keeps the noise on actions apart from the draws of batches.
Observation = Mapping[str, Tensor]


@typed
@dataclasses.dataclass(frozen=True)
class StudentSettings:
    """Settings of a student.

    Attributes:
        privileged: name of the observation that the teacher takes, such as "markov".
        frames: number of successive images that the student sees.
        channels: number of filters of each convolution.
        features: size of the encoding of the images.
        hidden: sizes of the layers behind it.
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
        teacher_until: share of the training over which that falls to zero.
        noise: standard deviation of the noise on actions that are carried out.
        wild_noise: the same in an eighth of the environments, added to `noise`.

    Raises:
        InvalidArgumentError: for a number out of range.
    """

    privileged: str = "markov"
    frames: int = 2
    channels: int = 48
    features: int = 256
    hidden: tuple[int, ...] = (1024, 1024)
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
    teacher_until: float = 0.2
    noise: float = 0.05
    wild_noise: float = 0.3

    def __post_init__(self):
        for name in ("frames", "channels", "features", "updates", "batch", "buffer", "warm_up"):
            check_count(name, getattr(self, name), 1)
        check_count("shift", self.shift, 0)
        for name in ("teacher_share", "teacher_until"):
            check_number(name, getattr(self, name), ge=0.0, le=1.0)


@typed
@dataclasses.dataclass(frozen=True)
class DistillSettings(StudentSettings):
    """Settings of distillation.

    Attributes:
        teacher: file of the teacher, a policy that `torch.export.save` wrote.
    """

    teacher: str = ""


class Student(nn.Module):
    """Actions of stacked observations.

    Attributes:
        frames: number of successive images that it sees.
        images: names of observations that are images, which must be of one size.
        others: names of all other observations.
    """

    def __init__(
        self, settings: StudentSettings, shapes: Mapping[str, tuple[int, ...]], action: int
    ):
        """Draws the weights from PyTorch's generator.

        Args:
            settings: sizes.
            shapes: of a single observation by name.
            action: size of an action.

        Raises:
            InvalidArgumentError: for observations without an image, or too small ones.
        """
        super().__init__()
        self.frames = settings.frames
        self.images = [name for name, shape in shapes.items() if len(shape) > 1]
        self.others = [name for name, shape in shapes.items() if len(shape) == 1]
        examples = [pictured(torch.zeros(shapes[name])) for name in self.images]
        sides = [*examples[0].shape[:2]] if examples else [0]
        inputs = settings.frames * sum(example.shape[-1] for example in examples)
        layers: list[nn.Module] = []
        for kernel, stride in _LAYERS:
            layers += [nn.Conv2d(inputs, settings.channels, kernel, stride), nn.ReLU()]
            inputs, sides = settings.channels, [(side - kernel) // stride + 1 for side in sides]
        if min(sides) < 1:
            raise InvalidArgumentError("observation", dict(shapes), "images of 35 pixels or more")
        self.encoder = nn.Sequential(
            *layers, nn.Flatten(), nn.Linear(inputs * sides[0] * sides[1], settings.features),
            nn.LayerNorm(settings.features), nn.Tanh(),
        )  # fmt: skip
        width = settings.features + sum(shapes[name][0] for name in self.others)
        head: list[nn.Module] = []
        for size, following in itertools.pairwise((width, *settings.hidden, action)):
            head += [nn.Linear(size, following), nn.ReLU()]
        self.head = nn.Sequential(*head[:-1], nn.Tanh())

    def forward(self, observation: Observation) -> Tensor:
        """Returns actions (n, action).

        Args:
            observation: images (n, frames, ...), the oldest first, and other numbers (n, k).
        """
        seen = [
            frame.float() / 255.0 if frame.dtype == torch.uint8 else frame.float()
            for name in self.images
            for frame in pictured(observation[name], 2).unbind(1)
        ]
        encoded = self.encoder(torch.cat(seen, dim=-1).movedim(-1, 1))  # Channels stay last.
        return self.head(torch.cat([encoded, *(observation[n].float() for n in self.others)], -1))


class Distill:
    """Students of several seeds, updated one after the other.

    Attributes:
        updates: number of updates of each.
        students: one of each seed.
    """

    FRAMES = Frames  # Class of `frames`.

    def __init__(
        self, settings: StudentSettings, problem: Problem, teacher: Callable[[Tensor], Tensor]
    ):
        """Draws the students and makes room for what they learn from.

        Args:
            settings: how they learn.
            problem: learning problem.
            teacher: gives actions (seeds, n, action) for privileged observations (seeds, n, k).
        """
        self._settings, self._problem, self._teacher = settings, problem, teacher
        shapes = {name: s for name, s in problem.shapes.items() if name != settings.privileged}
        at = problem.device
        self.students = []
        for seed in problem.seeds:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(seed)
                student = Student(settings, shapes, problem.action)
            self.students.append(student.to(at, memory_format=torch.channels_last))
        self._rate = torch.tensor(settings.rate, device=at)
        decay, on_gpu = settings.weight_decay, dict.fromkeys(("capturable", "fused"), at == "cuda")
        self._optimizers = [
            torch.optim.AdamW(student.parameters(), self._rate, weight_decay=decay, **on_gpu)
            for student in self.students
        ]
        self.updates = self._steps = 0
        self.frames = self.FRAMES(
            settings.buffer // problem.num_envs, problem.seeds, problem.num_envs,
            {**shapes, LABEL: (problem.action,)}, frames=settings.frames, shift=settings.shift,
            device=at,
        )  # fmt: skip
        self._noise = generators([seed + _NOISE_SEEDS for seed in problem.seeds], at)
        self._again = CudaGraph(self._update, self.frames.sources)

    def act(
        self, observation: Observation, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions (seeds, n, action), and stacks (seeds, n, frames, ...) of images."""
        stacks = {
            name: stacked(observation[name], (memory or {}).get(name), first, self._settings.frames)
            for name in self.students[0].images
        }
        with torch.no_grad(), self._precision(explore):
            action = torch.stack([
                student({name: array[k] for name, array in {**observation, **stacks}.items()})
                for k, student in enumerate(self.students)
            ]).float()  # fmt: skip
        return (self._explored(action, observation, first) if explore else action), stacks

    def _explored(self, action: Tensor, observation: Observation, first: Tensor) -> Tensor:
        """Keeps what is seen with the teacher's labels; returns actions to carry out."""
        settings, num_envs = self._settings, self._problem.num_envs
        with torch.no_grad():
            label = self._teacher(observation[settings.privileged])
        self.frames.add({**observation, LABEL: label}, first)
        number = torch.arange(num_envs, device=action.device)[:, None]
        wild = settings.wild_noise * (number >= num_envs - num_envs // 8)
        noise = (settings.noise + wild) * drawn(self._noise, *action.shape[1:])
        is_driven = number < self._teacher_share() * num_envs
        return (torch.where(is_driven, label, action) + noise).clamp(-1.0, 1.0)

    def _teacher_share(self) -> float:
        """Returns the share of the environments in which the teacher acts."""
        until = self._settings.teacher_until * self._problem.env_steps / self._problem.num_envs
        left = 1.0 - self._steps / until if until else 0.0
        return self._settings.teacher_share * max(left, 0.0)

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Updates the students; returns their last losses (seeds,)."""
        self._steps += 1
        left = max(1.0 - self._steps * self._problem.num_envs / self._problem.env_steps, 0.0)
        risen = min(self._steps / self._settings.warm_up, 1.0)
        self._rate.fill_(self._settings.rate * risen * left)
        result = [self._again() for _ in range(self._settings.updates)]
        self.updates += self._settings.updates
        return result[-1]

    def _update(self) -> dict[str, Tensor]:
        losses = []
        for k, (student, optimizer) in enumerate(zip(self.students, self._optimizers, strict=True)):
            loss = self.loss(student, self.frames.sample(k, self._settings.batch))
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(student.parameters(), self._settings.gradient_norm)
            optimizer.step()
            losses.append(loss.detach())
        return {"loss": torch.stack(losses)}

    def loss(self, student: nn.Module, batch: Observation) -> Tensor:
        """Returns the smooth L1 distance of a student's actions from the batch's labels."""
        with self._precision(True):
            action = student(batch)
        return nn.functional.smooth_l1_loss(action.float(), batch[LABEL], beta=self._settings.beta)

    def _precision(self, is_reduced: bool) -> torch.autocast:
        on_gpu = self._problem.device == "cuda"
        return torch.autocast("cuda", torch.bfloat16, enabled=is_reduced and on_gpu)

    def policy(self, seed: int) -> nn.Module:
        """Returns the student of the seed at a place, on the CPU, with weights of 16 bits."""
        student = copy.deepcopy(self.students[seed])
        policy = StoredInHalf(student.to("cpu", memory_format=torch.contiguous_format))
        policy.frames = self._settings.frames
        return policy

    def get_state(self) -> dict[str, Any]:
        """Returns all that `set_state` needs to continue with the same numbers."""
        return {
            "students": [student.state_dict() for student in self.students],
            "optimizers": [optimizer.state_dict() for optimizer in self._optimizers],
            "frames": self.frames.get_state(),
            "noise": [source.get_state() for source in self._noise],
            "counts": [self.updates, self._steps],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Continues from what `get_state` returned."""
        for student, saved in zip(self.students, state["students"], strict=True):
            student.load_state_dict(saved)
        for optimizer, saved in zip(self._optimizers, state["optimizers"], strict=True):
            optimizer.load_state_dict(saved)
            optimizer.param_groups[0]["lr"] = self._rate
        self.frames.set_state(state["frames"])
        for source, saved in zip(self._noise, state["noise"], strict=True):
            source.set_state(saved)
        self.updates, self._steps = state["counts"]


def make(settings: DistillSettings, problem: Problem) -> Distill:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for a problem without images, or no teacher.
        StoreError: for a teacher's file that cannot be read.
    """
    if not settings.teacher:
        valid = "a file of a policy: softgym-mj train distill TASK --teacher FILE.pt2 --trust"
        raise InvalidArgumentError("teacher", settings.teacher, valid)
    exported = torch.export.load(io.BytesIO(read_whole(settings.teacher)))
    # A file has a policy of a single observation: vmap makes it one of many.
    teacher = torch.func.vmap(move_to_device_pass(exported, problem.device).module())

    def labels(states: Tensor) -> Tensor:
        return teacher(states.flatten(0, 1)[:, None])[:, 0].unflatten(0, states.shape[:2])

    return Distill(settings, problem, labels)
