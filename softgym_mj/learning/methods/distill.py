"""Distillation: a policy of images or states imitates a state policy, for several seeds.

DAgger (Ross et al., 2011): the student acts, the teacher labels what the student meets, and the
student is fitted to the labels of the newest env steps.
"""

import copy
import dataclasses
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.export.passes import move_to_device_pass

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.frames import Frames, stacked
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.students import Observation, Student, StudentSettings
from softgym_mj.learning.networks import StoredInHalf, drawn, generators, whole_numbers
from softgym_mj.learning.point_encoder import POINTS, layout_of
from softgym_mj.learning.signed_orders import signed_orders, turned
from softgym_mj.learning.symmetries import check_observed, symmetries
from softgym_mj.policies.saved import imported
from softgym_mj.storage.files import read_whole
from softgym_mj.tasks.shared.observations import names_of
from softgym_mj.validation import typed

LABEL = "label"  # Beside observations: the teacher's action.
_NOISE_SEEDS = 1_000_003  # Keeps the noise on actions apart from the draws of batches.


@typed
@dataclasses.dataclass(frozen=True)
class DistillSettings(StudentSettings):
    """Settings of distillation.

    Attributes:
        teacher: the teacher: a file of a policy that `torch.export.save` wrote, or
            "module:function" of a function that maps privileged observations (..., k) to actions.
    """

    teacher: str = ""


class Distill:
    """Students of several seeds, updated one after the other.

    Attributes:
        updates: number of updates of each.
        students: one of each seed.
    """

    def __init__(
        self, settings: StudentSettings, problem: Problem, teacher: Callable[[Observation], Tensor]
    ):
        """Draws the students and allocates their replay buffer.

        Args:
            settings: how they learn.
            problem: learning problem.
            teacher: Maps observations (seeds, n, ...) by name to actions (seeds, n, action).
        """
        self._settings, self._problem, self._teacher = settings, problem, teacher
        own = names_of(problem.observed)
        shapes = {name: shape for name, shape in problem.shapes.items() if name in own}
        at = problem.device
        layout = None
        if settings.points:
            found = [name for name in own if name in POINTS]
            if not found or any(len(shape) > 1 for shape in shapes.values()):
                valid = f"one of {', '.join(POINTS)}, and other numbers, with points=True"
                raise InvalidArgumentError("observation", problem.observed, valid)
            # An encoder of points sees the first observation with points before all others.
            shapes = {found[0]: shapes[found[0]], **shapes}
            layout = layout_of(problem.example(), found[0])
        self._orders: dict[str, tuple[Tensor, Tensor]] = {}  # And signs, of each symmetry.
        if settings.symmetric:
            check_observed(own)
            env = problem.example()
            for name in own:
                orders, signs, of_actions, turns = signed_orders(symmetries(env, name), at)
                self._orders |= {name: (orders, signs), LABEL: (of_actions, turns)}
        self.students = []
        for seed in problem.seeds:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(seed)
                student = Student(settings, shapes, problem.action, layout)
            self.students.append(student.to(at, memory_format=torch.channels_last))
        self._rate = torch.tensor(settings.rate, device=at)
        decay, on_gpu = settings.weight_decay, dict.fromkeys(("capturable", "fused"), at == "cuda")
        self._optimizers = [
            torch.optim.AdamW(student.parameters(), self._rate, weight_decay=decay, **on_gpu)
            for student in self.students
        ]
        self.updates = self._steps = 0
        self.frames = Frames(
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
        """Stores observations with the teacher's labels; returns actions to execute."""
        settings, num_envs = self._settings, self._problem.num_envs
        with torch.no_grad():
            label = self._teacher(observation)
        self.frames.add({**observation, LABEL: label}, first)
        number = torch.arange(num_envs, device=action.device)[:, None]
        wild = settings.wild_noise * (number >= num_envs - num_envs // 8)
        noise = (settings.noise + wild) * drawn(self._noise, *action.shape[1:])
        is_driven = number < self._teacher_share() * num_envs
        return (torch.where(is_driven, label, action) + noise).clamp(-1.0, 1.0)

    def _teacher_share(self) -> float:
        """Returns the share of the environments in which the teacher acts."""
        share, until = self._settings.teacher_share, self._settings.teacher_until
        if until is None:
            return share
        steps = until * self._problem.env_steps / self._problem.num_envs
        return share * max(1.0 - self._steps / steps, 0.0) if steps else 0.0

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
            loss = self.loss(student, self._sampled(k))
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(student.parameters(), self._settings.gradient_norm)
            optimizer.step()
            losses.append(loss.detach())
        return {"loss": torch.stack(losses)}

    def _sampled(self, k: int) -> dict[str, Tensor]:
        """Returns a batch of the k-th seed."""
        batch = self.frames.sample(k, self._settings.batch)
        if self._orders:
            share = drawn(self.frames.sources[k : k + 1], self._settings.batch, normal=False)[0]
            which = whole_numbers(share, len(self._orders[LABEL][0]))
            for name, of_each in self._orders.items():
                batch[name] = turned(batch[name], which, *of_each)
        return batch

    def loss(self, student: Student, batch: Observation) -> Tensor:
        """Returns the loss of a student's actions for the batch's labels, by their form."""
        with self._precision(True):
            outputs = student.outputs(batch).float()
        return student.form.loss(outputs, batch[LABEL])

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
        InvalidArgumentError: for a problem of one observation.
        StoreError: for a teacher's file that cannot be read.
    """
    return Distill(settings, problem, _checked(settings, problem))


def _checked(settings: DistillSettings, problem: Problem) -> Callable[[Observation], Tensor]:
    """Returns a teacher that raises `InvalidArgumentError` unless it can label a problem."""
    name, names = settings.teacher, settings.privileged.split("+")
    teacher = _teacher(name, names, problem.device)

    def labels(observation: Observation) -> Tensor:
        shapes = {each: tuple(observation[each].shape) for each in names}
        lead = next(iter(shapes.values()))[:-1]
        valid = f"actions {(*lead, problem.action)} for observations {shapes}"
        try:
            result = teacher(observation)
        except Exception as error:  # Whatever a function raises, or the guards of a file.
            failed = f"{type(error).__name__}: {error}"
            message = f"teacher={name!r} failed: expected {valid}: {failed}"
            raise InvalidArgumentError(message) from error
        if not isinstance(result, Tensor) or result.shape != (*lead, problem.action):
            found = tuple(result.shape) if isinstance(result, Tensor) else type(result).__name__
            raise InvalidArgumentError(f"teacher={name!r} returns {found}: expected {valid}")
        return result

    return labels


def _teacher(name: str, names: Sequence[str], device: str) -> Callable[[Observation], Tensor]:
    """Returns a function from observations (seeds, n, ...), of which it takes these, to actions.

    A function of a module takes them joined; a file takes them by name, unless it has one.
    """
    if ":" in name:
        function = imported(name, "teacher")
        return lambda observation: function(torch.cat([observation[each] for each in names], -1))
    exported = torch.export.load(io.BytesIO(read_whole(name)))
    # A file has a policy of a single environment: vmap makes it one of many.
    teacher = torch.func.vmap(move_to_device_pass(exported, device).module())

    def labels(observation: Observation) -> Tensor:
        seen = {each: observation[each].flatten(0, 1)[:, None] for each in names}
        actions = teacher(seen if len(names) > 1 else seen[names[0]])[:, 0]
        return actions.unflatten(0, observation[names[0]].shape[:2])

    return labels
