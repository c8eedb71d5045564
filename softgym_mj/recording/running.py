"""Records a dataset; an interrupted recording continues from its finished episodes.

Every episode is a pure function of the configuration and its variation.
"""

import copy
import functools
import json
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

import gymnasium
import numpy as np

from softgym_mj import registry
from softgym_mj.envs.gymnasium_env import check_arguments
from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_name
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.experts import sources_sha256
from softgym_mj.policies.rollouts import sent_to
from softgym_mj.policies.saved import is_saved, sha256
from softgym_mj.recording.datasets import EPISODES, About
from softgym_mj.recording.episodes import LABEL, nested, played
from softgym_mj.recording.formats import dataset_name, make_format
from softgym_mj.recording.noise import check_noise
from softgym_mj.storage.store import ARRAYS, Store
from softgym_mj.validation import typed
from softgym_mj.variations.indices import SPLITS, check_settings, check_variation

IDLE = ("keep", "drop")
_NO_NUMBERS = ("cameras", LABEL)  # Infos that are omitted in `on_episode`.


@typed
def record(
    task: str,
    variations: Sequence[int],
    policy: str = "scripted",
    *,
    dataset: str | None = None,
    format: str = "minari",
    codec: str | None = None,
    seed: int = 0,
    trust: bool = False,
    successful_only: bool = False,
    idle: str = "keep",
    noise: float = 0.0,
    jobs: int = 1,
    author: str | None = None,
    author_email: str | None = None,
    code_permalink: str | None = None,
    on_episode: Callable[[dict], None] = lambda info: None,
    **settings: Any,
) -> Any:
    """Plays a policy once in each variation and stores the episodes as a dataset.

    With noise, the dataset's actions are the applied ones, and `infos["expert_action"]` has the
    policy's own. LeRobot datasets have the policy's own actions as "action" and the applied ones as
    "executed_action".

    Each finished episode is stored in a file. The same call continues an interrupted recording,
    also with other variations. If the dataset exists, it is returned and nothing is played.

    The environment that the dataset names draws variations of the split that contains all recorded
    ones ("all" if there is none); `recover_environment(eval_env=True)` draws those of "evaluate".

    Args:
        task: Task name, or "module:name" as in `registry.find`.
        variations: Different indices, in the order of the episodes.
        policy: Policy name, file or function, as in `policies.factory.make_policy`.
        dataset: Id of the dataset; None for `dataset_name` of task, policy, actor, grasp, action
            and noise.
        format: "minari" or "lerobot".
        codec: Codec of LeRobot's videos: "libsvtav1" (AV1, the default), "h264", "hevc" or "auto";
            "png" stores images without loss. Minari's images are lossless.
        seed, trust: Arguments of `make_policy`; the seed is also that of the noise.
        successful_only: Whether to omit episodes whose last `info["success"]` is false.
        idle: "keep", or "drop" to truncate an episode when the expert has `finished` and cloth or
            rope is at rest.
        noise: Standard deviation of the noise on actions, 0..1, as in `noise.disturbance`; an
            expert that has `finished` acts without noise. 0 with the policy "random".
        jobs: Number of processes; the dataset does not depend on it.
        author, author_email, code_permalink: Metadata of a Minari dataset; None omits them.
        on_episode: Called with the numbers of the last info of each finished episode.
        **settings: Keyword arguments of the Gymnasium environment, such as `observation`.

    Returns:
        The dataset as its library reads it: `minari.MinariDataset` or `LeRobotDataset`.

    Raises:
        UnavailableError: if the library is missing.
        StoreError: if a dataset of this id has other settings or cannot be written, or if an
            unfinished recording has other settings or damaged files.
        InvalidArgumentError: for an invalid argument or combination: no variation, an author that
            the format cannot store, `idle="drop"` with a policy that is no expert, noise on random
            actions, settings that JSON cannot hold, no expert of the task; if no episode is left.
    """
    check_settings(settings)
    result = check_arguments(task, settings, record)
    variations = [check_variation(variation) for variation in variations]
    check_name("idle", idle, IDLE)
    if idle == "drop" and policy != "scripted":
        raise InvalidArgumentError("idle", idle, f"'keep' with policy={policy!r}")
    check_noise(noise, seed, policy)
    if not variations or len({*variations}) < len(variations):
        raise InvalidArgumentError("variations", variations, "at least one, each of them once")
    kind = make_format(format, codec)
    signed = author, author_email, code_permalink
    kind.check_signed(*signed)
    if dataset is None:
        acts = settings.get("actor"), settings.get("grasp"), settings.get("action")
        dataset = dataset_name(result.name, policy, *acts, noise=noise, format=format)
    kind.check_id(dataset)
    named = task if isinstance(task, str) and ":" in task else _with_module(result)
    split = next(name for name, own in SPLITS.items() if set(variations) <= set(own))
    with gymnasium.make(result.gymnasium_id, task=named, split=split, **settings) as env:
        evaluation = _evaluation_spec(env, settings)
        kind.check_observed(env)
        configuration = {
            "task": named,
            "policy": policy,
            "policy_sha256": _sources(policy, seed, result),
            "seed": seed,
            "settings": settings,
            "idle": idle,
            **({"noise": noise} if noise else {}),
            "versions": {name: version(name) for name in ("softgym_mj", "mujoco")},
        }
        made_of = {
            **configuration,
            **kind.described(),
            "variations": variations,
            "successful_only": successful_only,
        }
        if kind.is_finished(dataset, made_of):
            return kind.load(dataset)
        unfinished = kind.unfinished(dataset)
        store = Store(unfinished / EPISODES, configuration, ARRAYS)
        if differ := store.differences():
            raise StoreError(
                f"{unfinished} holds episodes of an unfinished recording with another "
                f"{', '.join(differ)}; finish that, choose another dataset or delete the folder"
            )
        successful = set()

        def add(variation: int, arrays: dict[str, np.ndarray]) -> None:
            infos = nested(arrays)["infos"]
            last = {name: values[-1] for name, values in infos.items() if name not in _NO_NUMBERS}
            if last["success"]:
                successful.add(variation)
            on_episode(last)

        with make_executor(jobs) as executor:
            sent = sent_to(executor, result), json.dumps(settings, sort_keys=True)
            play_one = functools.partial(played, *sent, policy, seed, trust, idle, noise)
            store.run(variations, play_one, executor, add)
        description = result.summary
        if successful_only:
            count, variations = len(variations), [v for v in variations if v in successful]
            if not variations:
                valid = f"False, as none of the {count} episodes is successful"
                raise InvalidArgumentError("successful_only", True, valid)
            counts = f"{len(variations)} of {count} episodes, those with success."
            description = f"{description} {counts}".lstrip()
        buffers = (
            {"seed": seed, "options": {"variation": variation}, **nested(store.get(variation))}
            for variation in variations
        )
        about = About(result, policy, description, evaluation, *signed)
        return kind.write(dataset, made_of, env, buffers, about)


def _sources(policy: str, seed: int, task: registry.TaskRecord) -> dict[str, str]:
    """Returns the SHA-256 of the sources of a policy, by name."""
    if policy == "scripted":
        return {policy: sources_sha256(task)}
    return sha256(policy, seed) if is_saved(policy) else {}


def _evaluation_spec(env: gymnasium.Env, settings: dict[str, Any]) -> str:
    """Returns the environment with evaluation variations, as JSON.

    Raises:
        InvalidArgumentError: if JSON cannot hold the settings.
    """
    assert env.spec is not None
    spec = copy.deepcopy(env.spec)
    spec.kwargs["split"] = "evaluate"
    try:
        return spec.to_json()
    except TypeError as error:
        raise InvalidArgumentError(
            "settings", settings, f"values that JSON can store ({error})"
        ) from None


def _with_module(record: registry.TaskRecord) -> str:
    """Returns the name of a task, with the module of its class if other processes can import it.

    Classes of scripts and notebooks cannot be imported.
    """
    task_class = record.resolve()
    module, name = task_class.__module__, task_class.__qualname__
    result = getattr(sys.modules.get(module), name, None) is task_class
    if not record.is_custom or module == "__main__" or not result:
        return record.name
    return f"{module}:{record.name}"
