"""`make_vec`: builds a vector environment from the name of a task."""

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from gymnasium.vector import AutoresetMode

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.registry import TaskRecord

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
    """Builds a vector environment; `gymnasium.make_vec` with the id of a task calls it.

    Args:
        task: Task name or record, as in `registry.find`.
        num_envs: Number of environments, 1 or more.
        device: "cpu" simulates in worker processes; "cuda" on a GPU with PyTorch tensors (actions
            may be tensors, too); "host" runs the same batch code in this process with NumPy
            arrays. "cuda" and "host" support pickers, cups and arms; states and images, with the
            limits of docs/gpu.md.
        num_workers: Number of processes, or of threads of "host", 1..num_envs; one per core by
            default. Two per core balance variations of very different cost, such as water, at some
            overhead each. Not allowed with "cuda".
        autoreset_mode: Gymnasium's mode of automatic resets. "NextStep": the step after the last
            one resets, ignores its action and has reward 0. "SameStep": the last step returns the
            first observation of the next episode, and its own in info["final_obs"] and
            info["final_info"]. "Disabled": the caller resets with options={"reset_mask": ended}.
        context: Start method of processes: "forkserver" where available, else "spawn", by default;
            both do not run the main script again. "fork" starts at once, but copies this process
            with its locks: neither other threads nor OpenGL survive it.
        split: "train", "evaluate", "all" or a sequence of variation indices to draw from.
        **task_kwargs: Arguments of `SoftGymEnv` (render_mode, horizon, observation, actor, ...).

    Returns:
        The environment; observations, rewards and infos have a leading axis (num_envs,), and
        actions (num_envs, n) are in [-1, 1].

    Raises:
        InvalidArgumentError, UnexpectedArgumentError: If a name or value is invalid.
    """
    check_name("device", device, DEVICES)
    if not isinstance(autoreset_mode, AutoresetMode):
        check_name("autoreset_mode", autoreset_mode, _MODES)
    from softgym_mj.envs.gymnasium_env import SoftGymEnv, check_arguments
    from softgym_mj.variations.indices import split_indices
    from softgym_mj.vector.base import VectorEnv
    from softgym_mj.vector.processes import ProcessBackend

    # Worker processes get the record, because they may not have registered the same tasks.
    record = check_arguments(task, task_kwargs, make_vec)
    variations = split_indices(split)
    make = functools.partial(SoftGymEnv, record, split=split, **task_kwargs)
    backend: Backend
    if device == "cpu":
        backend = ProcessBackend(make, num_envs, num_workers=num_workers, context=context)
        return VectorEnv(backend, variations, AutoresetMode(autoreset_mode))
    from softgym_mj.vector.batch.backend import BatchBackend

    if context is not None:
        raise InvalidArgumentError("context", context, f"None with device={device!r}")
    batch_device = make_device(device, check_count("num_envs", num_envs, 1), num_workers)
    backend = BatchBackend(make(), num_envs, batch_device, make)
    return VectorEnv(backend, variations, AutoresetMode(autoreset_mode))


def make_device(device: str, num_envs: int, num_workers: int | None = None) -> "Device":
    """Returns the device that stores and steps a batch.

    Args:
        device: "host" or "cuda".
        num_envs, num_workers: As in `make_vec`.
    """
    if device == "cuda":
        from softgym_mj.batch.gpu import CudaDevice

        if num_workers is not None:
            raise InvalidArgumentError("num_workers", num_workers, "None with device='cuda'")
        return CudaDevice()
    from softgym_mj.batch.device import CpuDevice
    from softgym_mj.vector.processes import num_cores

    threads = min(num_envs, num_cores()) if num_workers is None else num_workers
    return CpuDevice(check_count("num_workers", threads, 1, num_envs))
