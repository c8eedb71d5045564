"""`make_vec`: from the name of a task to many environments of it."""

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from gymnasium.vector import AutoresetMode

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.registry import TaskRecord, find

if TYPE_CHECKING:
    from softgym_mj.batch.device import Device
    from softgym_mj.vector.backend import Backend
    from softgym_mj.vector.base import VectorEnv

DEVICES = ("cpu", "host", "cuda")
_MODES = [mode.value for mode in AutoresetMode]


def make_vec(
    task: str | TaskRecord,
    num_envs: int,
    *,
    device: str = "cpu",
    num_workers: int | None = None,
    autoreset_mode: str | AutoresetMode = "NextStep",
    context: str | None = None,
    split: str | Sequence[int] = "train",
    **task_kwargs: Any,
) -> "VectorEnv":
    """Builds many environments of a task; `gymnasium.make_vec` with the id of a task ends here.

    Args:
        task: task name, or as in `registry.find`.
        num_envs: number of environments, 1 or more.
        device: what simulates: "cpu", worker processes; "cuda", a GPU on which all lies in
            PyTorch's tensors, actions too if you like; "host", the same in NumPy's arrays in this
            process. The last two know pickers and cups, states and images, but no arms.
        num_workers: number of processes, or of threads of "host", 1..num_envs; by default one a
            core. Two a core balance variations that differ a lot in cost, as those of water do;
            each costs some time. None of "cuda".
        autoreset_mode: what follows the last step of an episode. "NextStep": the next step
            resets, ignores its action and has reward 0. "SameStep": the last step returns the
            first observation of the next episode, and its own in info["final_obs"] and
            info["final_info"]. "Disabled": you reset, with options={"reset_mask": ended}.
        context: how processes start: "forkserver" where there is one, else "spawn", by default;
            they do not run the program's script again. "fork" starts them at once, but copies this
            process with its locks: neither other threads nor OpenGL survive that.
        split: "train", "evaluate", "all" or a sequence of variation indices to draw from.
        **task_kwargs: of `SoftGymEnv` (render_mode, horizon, observation, actor, ...).

    Raises:
        InvalidArgumentError, UnexpectedArgumentError: for a bad name or value.
        InvalidArgumentError: as in `registry.find`.
    """
    check_name("device", device, DEVICES)
    if not isinstance(autoreset_mode, AutoresetMode):
        check_name("autoreset_mode", autoreset_mode, _MODES)
    record = find(task)  # Another process has not necessarily registered the same tasks.
    from softgym_mj.envs.gymnasium_env import SoftGymEnv
    from softgym_mj.variations.indices import split_indices
    from softgym_mj.vector.base import VectorEnv
    from softgym_mj.vector.processes import ProcessBackend

    variations = split_indices(split)
    make = functools.partial(SoftGymEnv, record, split=split, **task_kwargs)
    backend: Backend
    if device == "cpu":
        backend = ProcessBackend(make, num_envs, num_workers=num_workers, context=context)
        return VectorEnv(backend, variations, AutoresetMode(autoreset_mode))
    from softgym_mj.vector.batch.backend import BatchBackend

    if context is not None:
        raise InvalidArgumentError("context", context, "None: there are no processes")
    batch_device = make_device(device, check_count("num_envs", num_envs, 1), num_workers)
    backend = BatchBackend(make(), num_envs, batch_device, make)
    return VectorEnv(backend, variations, AutoresetMode(autoreset_mode))


def make_device(device: str, num_envs: int, num_workers: int | None = None) -> "Device":
    """Returns the device that stores and steps a batch.

    Args:
        device: "host" or "cuda".
        num_envs, num_workers: of `make_vec`.
    """
    if device == "cuda":
        from softgym_mj.batch.gpu import CudaDevice

        if num_workers is not None:
            raise InvalidArgumentError("num_workers", num_workers, "None: there are none")
        return CudaDevice()
    from softgym_mj.batch.device import CpuDevice
    from softgym_mj.vector.processes import num_cores

    threads = min(num_envs, num_cores()) if num_workers is None else num_workers
    return CpuDevice(check_count("num_workers", threads, 1, num_envs))
