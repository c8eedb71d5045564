"""`TorchRLEnv`: a vector environment for TorchRL, on CPUs or a GPU."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Composite, TensorSpec, Unbounded
from torchrl.envs import EnvBase

from softgym_mj.envs.gymnasium_env import check_arguments
from softgym_mj.exceptions import InvalidArgumentError, UnexpectedArgumentError, check_name
from softgym_mj.registry import TaskRecord
from softgym_mj.vector.make import make_vec

_ENDS = ("done", "terminated", "truncated")


class TorchRLEnv(EnvBase):
    """TorchRL environment with batch size (num_envs,), built by `make_vec`.

    A single observation is called "observation", several have their own names. Episodes end with
    "truncated"; "terminated" means that the simulation has diverged.

    Attributes:
        envs: The vector environment.
    """

    def __init__(
        self,
        /,
        task: str | TaskRecord,
        num_envs: int,
        *,
        device: str = "cpu",
        info: Sequence[str] = (),
        **settings: Any,
    ):
        """Makes the environments.

        Args:
            task, num_envs, device: As in `make_vec`; with "cuda" all tensors are on the GPU.
            info: Names of info scalars to return, as float32 (num_envs, 1).
            **settings: Further arguments of `make_vec`, except `autoreset_mode`.

        Raises:
            InvalidArgumentError: If an argument is invalid; for an unknown name in `info`, the
                first reset raises it.
            UnexpectedArgumentError: For an unknown argument.
        """
        if isinstance(info, str):
            raise InvalidArgumentError("info", info, "a sequence of names")
        if "autoreset_mode" in settings:
            raise UnexpectedArgumentError(
                "TorchRLEnv got an unexpected keyword argument 'autoreset_mode': TorchRL resets "
                "environments itself."
            )
        check_arguments(task, settings, make_vec, TorchRLEnv.__init__)
        envs = make_vec(task, num_envs, device=device, autoreset_mode="Disabled", **settings)
        where = torch.device("cuda", 0) if device == "cuda" else torch.device("cpu")
        super().__init__(device=where, batch_size=torch.Size([num_envs]))
        self.envs = envs
        self._info = tuple(info)
        self._seed: int | None = None
        space = self.envs.observation_space
        if not isinstance(space, gymnasium.spaces.Dict):
            space = gymnasium.spaces.Dict({"observation": space})
        one = (num_envs, 1)
        self.observation_spec = Composite(
            {name: self._spec_of(part.shape, part.dtype) for name, part in space.items()}
            | {name: Unbounded(one, device=where) for name in self._info},
            shape=self.batch_size,
        )
        shape = self.envs.action_space.shape
        self.action_spec = Bounded(-1.0, 1.0, shape, device=where, dtype=torch.float32)
        self.reward_spec = Unbounded(one, device=where)
        ends = {name: Binary(shape=one, dtype=torch.bool, device=where) for name in _ENDS}
        self.full_done_spec = Composite(ends, shape=self.batch_size)
        self._ends = {name: torch.zeros(one, dtype=torch.bool, device=where) for name in _ENDS}

    def _spec_of(self, shape: tuple[int, ...] | None, dtype: Any) -> TensorSpec:
        """Returns the spec of an observation; that of images is bounded."""
        kind = getattr(torch, dtype.name)
        if kind == torch.uint8:
            return Bounded(0, 255, shape, device=self.device, dtype=kind)
        return Unbounded(shape, device=self.device, dtype=kind)

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDictBase:
        chosen = None if tensordict is None else tensordict.get("_reset", None)
        options = {}
        if chosen is not None:
            options["reset_mask"] = chosen.reshape(-1).cpu().numpy()
        seed, self._seed = self._seed, None
        observations, infos = self.envs.reset(seed=seed, options=options)
        for name in self._info:
            check_name("info", name, (key for key in infos if not key.startswith("_")))
        for name, ends in self._ends.items():
            kept = ends & ~chosen.reshape(ends.shape) if chosen is not None else ends & False
            self._ends[name] = kept
        return self._seen(observations, infos)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        actions = tensordict["action"]
        if self.device.type == "cpu":
            actions = actions.detach().numpy()
        observations, rewards, terminated, truncated, infos = self.envs.step(actions)
        terminated, truncated = (self._column(end, torch.bool) for end in (terminated, truncated))
        ends = (terminated | truncated, terminated, truncated)
        self._ends = dict(zip(_ENDS, ends, strict=True))
        found = self._seen(observations, infos)
        found["reward"] = self._column(rewards, torch.float32)
        return found

    def _seen(self, observations: Any, infos: dict[str, Any]) -> TensorDictBase:
        if not isinstance(observations, dict):
            observations = {"observation": observations}
        found = {name: torch.as_tensor(value) for name, value in observations.items()}
        found |= {name: self._column(infos[name], torch.float32) for name in self._info}
        return TensorDict(found | self._ends, batch_size=self.batch_size, device=self.device)

    def _column(self, values: Any, dtype: torch.dtype) -> torch.Tensor:
        return torch.as_tensor(values).to(dtype).reshape(-1, 1)

    def _set_seed(self, seed: int | None) -> None:
        self._seed = seed

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Closes the environments."""
        self.envs.close()
        super().close(raise_if_closed=raise_if_closed)
