"""Minari's side of a recording: ids, folders, a dataset from episodes."""

import os
import pathlib
import pickle
import re
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import gymnasium

from softgym_mj.exceptions import InvalidArgumentError, StoreError, import_extra
from softgym_mj.jobs.files import naming

if TYPE_CHECKING:
    import minari

EPISODES = ".episodes"  # In the folder of a dataset that is not finished.
_OVERHEAD = 1 << 20  # More than HDF5 needs for an episode besides its numbers [bytes].
_NO_LETTER = re.compile(r"[^-\w]")  # What an id cannot have.


def dataset_name(
    task: str,
    policy: str,
    actor: str | None = None,
    grasp: str | None = None,
    noise: float = 0.0,
) -> str:
    """The id that a dataset gets by default: "softgym_mj/fold_cloth/scripted-franka-v0".

    Args:
        task: task name, without a module.
        policy: as in `record`.
        actor, grasp: of the task; None, which the id does not mention, for its own.
        noise: as in `record`; 0.05 is "noise0-05", as ids have no points.
    """
    noisy = f"noise{noise:g}" if noise else None
    parts = filter(None, (policy, actor, grasp, noisy))
    return f"softgym_mj/{task}/{_NO_LETTER.sub('-', '-'.join(parts))}-v0"


def unfinished_folder(name: str) -> pathlib.Path:
    """Where a new dataset is made; beside the datasets, hidden from Minari.

    Its episodes are in `EPISODES`, until it is moved to its place and these are removed. Who was
    killed in between finds them there and goes on, with all of them.

    Raises:
        UnavailableError: if Minari is missing.
        InvalidArgumentError: if it is not an id of Minari's.
        StoreError: if the dataset exists; if the folders cannot be written.
    """
    minari = import_extra("minari", "Minari", "datasets")
    try:
        minari.dataset.minari_dataset.parse_dataset_id(name)
    except (ValueError, TypeError):  # The second without a version.
        valid = (
            "NAMESPACE/NAME-v0 of letters, digits, - and _, such as 'rope/expert-v0'; a namespace "
            "has two or more of them, can have parts (a/b/c) and can be left out"
        )
        raise InvalidArgumentError("dataset", name, valid) from None
    place, unfinished = _place(name), _place() / f".{name.replace('/', '.')}.unfinished"
    with naming(place, "written"):
        if (place / EPISODES).exists():
            place.rename(unfinished)
        elif os.path.lexists(place):
            raise StoreError(
                f"dataset={name!r} exists; choose another id, or remove it: `minari delete {name}`"
            )
    return unfinished  # No id has a point in it.


def is_finished(name: str) -> bool:
    """Whether there is a whole dataset of this id.

    Raises:
        UnavailableError: if Minari is missing.
    """
    place = _place(name)
    return os.path.lexists(place) and not (place / EPISODES).exists()


def _place(name: str | None = None) -> pathlib.Path:
    storage = import_extra("minari.storage", "Minari", "datasets")
    with naming(os.environ.get("MINARI_DATASETS_PATH", "the folder of Minari"), "written"):
        return storage.get_dataset_path(name)


def _check_room(folder: pathlib.Path, size: int) -> None:
    """Raises OSError unless so many bytes fit there: without room, HDF5 ends the process."""
    with tempfile.TemporaryFile(dir=folder) as stream:
        stream.write(bytes(size))
        stream.flush()
        os.fsync(stream.fileno())


def write_dataset(
    name: str,
    unfinished: pathlib.Path,
    env: gymnasium.Env,
    episodes: Iterable[dict[str, Any]],
    metadata: Mapping[str, Any],
) -> "minari.MinariDataset":
    """Writes a dataset, one episode after the other; it is there whole or not at all.

    Args:
        name: its id.
        unfinished: its `unfinished_folder`.
        env: where the episodes were played.
        episodes: keyword arguments of Minari's `EpisodeBuffer`.
        metadata: of the dataset, as Minari names it.

    Raises:
        StoreError: if it cannot be written; what was there of it is removed.
    """
    minari = import_extra("minari", "Minari", "datasets")
    place, data = _place(name), unfinished / "data"
    shutil.rmtree(data, ignore_errors=True)  # What a killed process left.
    try:
        with naming(place, "written"):
            # Not `create_dataset_from_buffers`, which wants all episodes and the final folder.
            storage = minari.dataset.minari_storage.MinariStorage.new(
                data,
                observation_space=env.observation_space,
                action_space=env.action_space,
                env_spec=env.spec,
                jpeg_encoding=False,  # It would change images.
            )
            versions = {"dataset_id": name, "minari_version": minari.__version__}
            storage.update_metadata({**versions, **metadata})
            for number, episode in enumerate(episodes):
                _check_room(unfinished, 2 * len(pickle.dumps(episode)) + _OVERHEAD)
                storage.update_episodes([minari.data_collector.EpisodeBuffer(id=number, **episode)])
            namespace = minari.dataset.minari_dataset.parse_dataset_id(name)[0]
            if namespace is not None and namespace not in minari.namespace.list_local_namespaces():
                minari.namespace.create_namespace(namespace)
            unfinished.rename(place)
            shutil.rmtree(place / EPISODES)
    except BaseException:
        shutil.rmtree(data, ignore_errors=True)
        raise
    return minari.load_dataset(name)
