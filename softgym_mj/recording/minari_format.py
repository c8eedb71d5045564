"""Minari's datasets, of which images are compressed without loss."""

import os
import pathlib
import pickle
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import gymnasium
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, import_extra
from softgym_mj.recording.datasets import About, Format
from softgym_mj.storage.files import naming

_OVERHEAD = 1 << 20  # More than HDF5 needs for an episode besides its numbers [bytes].
# Of a frame in a chunk of the file [bytes]: a chunk has the same stripe of all frames, one behind
# the other. Deflate looks back 32 KiB, so it sees a stripe's last thirty frames, which resemble
# each other; of whole frames it would not even see the last one.
_STRIPE = 1 << 10
_LEVEL = 6  # Of deflate; below, it gives up looking too soon: files of twice the size.
_IMAGE = 3  # Dimensions, with time, from which on observations are worth it.


class Minari(Format):
    """Minari, the Farama Foundation's format for Gymnasium environments."""

    default_id, is_signed = "softgym_mj/{task}/{words}-v0", True
    observation = "reduced"

    def check_id(self, dataset: str) -> None:
        """See `Format`."""
        minari = import_extra("minari", "Minari", "datasets")
        try:
            minari.dataset.minari_dataset.parse_dataset_id(dataset)
        except (ValueError, TypeError):  # The second without a version.
            valid = (
                "NAMESPACE/NAME-v0 of letters, digits, - and _, such as 'rope/expert-v0'; a "
                "namespace has two or more of them, can have parts (a/b/c) and can be left out"
            )
            raise InvalidArgumentError("dataset", dataset, valid) from None

    def root(self) -> pathlib.Path:
        """See `Format`."""
        storage = import_extra("minari.storage", "Minari", "datasets")
        with naming(os.environ.get("MINARI_DATASETS_PATH", "the folder of Minari"), "written"):
            return storage.get_dataset_path()

    def described(self) -> dict[str, Any]:
        """See `Format`."""
        return {"format": "minari"}

    def load(self, dataset: str) -> Any:
        """See `Format`."""
        return import_extra("minari", "Minari", "datasets").load_dataset(dataset)

    def summary(self, dataset: Any) -> tuple[int, int, str]:
        """See `Format`."""
        call = f"minari.load_dataset({dataset.spec.dataset_id!r})"
        return dataset.total_episodes, dataset.total_steps, call

    def build(
        self,
        folder: pathlib.Path,
        dataset: str,
        env: gymnasium.Env,
        episodes: Iterable[Mapping[str, Any]],
        about: About,
    ) -> None:
        """See `Format`."""
        minari = import_extra("minari", "Minari", "datasets")
        # Not `create_dataset_from_buffers`, which wants all episodes and the final folder.
        storage = minari.dataset.minari_storage.MinariStorage.new(
            folder / "data",
            observation_space=env.observation_space,
            action_space=env.action_space,
            env_spec=env.spec,
            jpeg_encoding=False,  # It would change images.
        )
        signed = {  # Minari wants sets of authors.
            "author": None if about.author is None else {about.author},
            "author_email": None if about.author_email is None else {about.author_email},
            "code_permalink": about.code_permalink,
        }
        storage.update_metadata({
            "dataset_id": dataset,
            "minari_version": minari.__version__,
            **{name: value for name, value in signed.items() if value is not None},
            "eval_env_spec": about.evaluation,
            "algorithm_name": about.policy,
            "description": about.description,
            "requirements": ["softgym_mj"],
        })  # fmt: skip
        for number, episode in enumerate(episodes):
            _check_room(folder, 2 * len(pickle.dumps(episode)) + _OVERHEAD)
            _place_images(folder / "data" / "main_data.hdf5", number, episode["observations"])
            storage.update_episodes([minari.data_collector.EpisodeBuffer(id=number, **episode)])
        namespace = minari.dataset.minari_dataset.parse_dataset_id(dataset)[0]
        if namespace is not None and namespace not in minari.namespace.list_local_namespaces():
            minari.namespace.create_namespace(namespace)


def _check_room(folder: pathlib.Path, size: int) -> None:
    """Raises OSError unless so many bytes fit there: without room, HDF5 ends the process."""
    with tempfile.TemporaryFile(dir=folder) as stream:
        stream.write(bytes(size))
        stream.flush()
        os.fsync(stream.fileno())


def _place_images(
    file: pathlib.Path, number: int, observations: np.ndarray | Mapping[str, Any]
) -> None:
    """Makes places for the images of an episode, into which Minari then appends them."""
    import h5py

    with h5py.File(file, "a", track_order=True) as opened:
        for name, array in _arrays(f"episode_{number}/observations", observations):
            if array.ndim >= _IMAGE:
                empty, longest = (0, *array.shape[1:]), (None, *array.shape[1:])
                opened.create_dataset(
                    name, empty, array.dtype, maxshape=longest, chunks=chunk(array),
                    compression="gzip", compression_opts=_LEVEL, shuffle=array.itemsize > 1,
                )  # fmt: skip


def _arrays(name: str, value: np.ndarray | Mapping[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """All arrays of nested dicts, with their paths."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _arrays(f"{name}/{key}", inner)
    else:
        yield name, value


def chunk(array: np.ndarray) -> tuple[int, ...]:
    """The shape of chunks (n, ...) of which a frame has no more than `_STRIPE` bytes."""
    shape = list(array.shape)
    for axis in range(1, array.ndim):
        size = int(np.prod(shape[1:])) * array.itemsize
        shape[axis] = min(shape[axis], max(1, shape[axis] * _STRIPE // size))
    return tuple(shape)
