"""Records episodes as a Minari dataset, the Farama Foundation's format for Gymnasium environments.

Minari keeps observations, actions, rewards and infos of whole episodes in HDF5 and is read by the
libraries for offline learning. Actions are kept as they were applied, in single precision: played
again from the variation in the infos they give the same observations, bit for bit.

A dataset of a task of your own names the module of the task, which `recover_environment` imports.
"""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import dm_env
import gymnasium

from softgym_mj import registry
from softgym_mj.baselines.policies import Policy, make_policy
from softgym_mj.exceptions import DatasetExistsError, OutOfRangeError
from softgym_mj.extras import import_extra
from softgym_mj.variations import check_variation

if TYPE_CHECKING:
    import minari


def dataset_name(task: str, policy: str, actor: str | None = None, grasp: str | None = None) -> str:
    """The id that a dataset gets by default: "softgym_mj/fold_cloth/scripted-franka-v0".

    Args:
        task: task name, without a module.
        policy: as in `record`.
        actor, grasp: of the task; None, which the id does not mention, for its own.
    """
    policy = policy.replace(":", "-").replace(".", "-")
    return f"softgym_mj/{task}/{'-'.join(filter(None, (policy, actor, grasp)))}-v0"


def record(
    task: str,
    variations: Sequence[int],
    policy: str = "scripted",
    *,
    dataset: str | None = None,
    seed: int = 0,
    on_episode: Callable[[dict], None] = lambda info: None,
    **settings: Any,
) -> "minari.MinariDataset":
    """Plays a policy once in each variation and stores what happens.

    Args:
        task: task name, or "module:name" as in `registry.find`.
        variations: indices, in the order of the episodes.
        policy: of `baselines.policies`.
        dataset: id of the dataset; None for `dataset_name` of task, policy, actor and grasp.
        seed: of the policy.
        on_episode: called with the last info of each episode.
        **settings: keyword arguments of the Gymnasium environment, such as `observation`.

    Raises:
        MissingExtraError: if Minari is missing.
        DatasetExistsError: if the dataset exists.
        OutOfRangeError: for a variation that does not exist, or none.
        UnknownNameError, TaskModuleError, PolicyFileError: for a bad task or policy.
        ExpertError: if the policy is "scripted" and the task has no expert.
    """
    found = registry.find(task)
    for variation in variations:
        check_variation(variation)
    if not variations:
        raise OutOfRangeError("variations", variations, "at least one")
    minari = import_extra("minari", "Minari", "datasets")
    name = dataset
    if name is None:
        name = dataset_name(found.name, policy, settings.get("actor"), settings.get("grasp"))
    if name in minari.list_local_datasets():
        raise DatasetExistsError(
            f"dataset={name!r} exists; choose another id, or remove it: `minari delete {name}`"
        )
    played = task if isinstance(task, str) and ":" in task else _with_module(found)
    env = gymnasium.make(found.gymnasium_id, task=played, split="all", **settings)
    try:
        act = make_policy(policy, env.unwrapped.dm_env, seed)  # type: ignore[attr-defined]
        episodes = []
        for number, variation in enumerate(variations):
            episodes.append(minari.data_collector.EpisodeBuffer(
                id=number, seed=seed, options={"variation": variation},
                **_episode(env, act, variation),
            ))  # fmt: skip
            on_episode({name: values[-1] for name, values in episodes[-1].infos.items()})
        return minari.create_dataset_from_buffers(
            name,
            episodes,
            env=env,
            eval_env=env,
            algorithm_name=policy,
            description=found.summary,
            requirements=["softgym_mj"],
            jpeg_encoding=False,  # It would change images.
        )
    finally:
        env.close()


def _with_module(record: registry.TaskRecord) -> str:
    """The name of a task with the module that another process has to import, if it can.

    That is the module of the task's constructor, as far as it is found there; what a script or a
    notebook defines is not.
    """
    constructor = record.constructor
    if isinstance(constructor, str):  # A task of the package.
        return record.name
    module, name = (getattr(constructor, key, "") for key in ("__module__", "__qualname__"))
    if module == "__main__" or getattr(sys.modules.get(module), name, None) is not constructor:
        return record.name
    return f"{module}:{record.name}"


def _episode(env: gymnasium.Env, act: Policy, variation: int) -> dict[str, Any]:
    """What happens in an episode, as lists over time; observations and infos have one entry more.

    Minari's own collector does the same, but needs JAX for it.
    """
    observation, info = env.reset(options={"variation": variation})
    timestep = dm_env.restart(_named(observation))
    observations, infos = [observation], [info]
    steps: dict[str, list] = {"actions": [], "rewards": [], "terminations": [], "truncations": []}
    while not (steps["truncations"] and (steps["truncations"][-1] or steps["terminations"][-1])):
        action = act(timestep).astype(env.action_space.dtype)
        observation, *outcome, info = env.step(action)
        timestep = dm_env.transition(outcome[0], _named(observation))
        observations.append(observation)
        infos.append(info)
        for values, value in zip(steps.values(), (action, *outcome), strict=True):
            values.append(value)
    return {**steps, "observations": _over_time(observations), "infos": _over_time(infos)}


def _over_time(values: list) -> list | dict[str, list]:
    """A list of dicts as a dict of lists."""
    if not isinstance(values[0], dict):
        return values
    return {name: [value[name] for value in values] for name in values[0]}


def _named(observation) -> dict:
    """An observation as policies get it."""
    return observation if isinstance(observation, dict) else {"observation": observation}
