"""Minari datasets, with losslessly compressed images."""

import os
import pathlib
import pickle
import tempfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, import_extra
from softgym_mj.recording.datasets import Format
from softgym_mj.storage.files import naming

_OVERHEAD = 1 << 20  # Upper bound of HDF5's overhead for an episode [bytes].
# Size of a frame in a chunk of the file [bytes]. A chunk has the same stripe of consecutive frames.
# Deflate searches the last 32 KiB, which are about thirty similar stripes but less than one whole
# frame.
_STRIPE = 1 << 10
_LEVEL = 6  # Level of deflate; lower levels give files of twice the size.
_IMAGE = 3  # Minimum number of dimensions, with time, of compressed observations.


class Minari(Format):
    """Minari, the Farama Foundation's format for Gymnasium environments."""

    default_id, is_signed = "softgym_mj/{task}/{words}-v0", True
    observation = "reduced"

    def check_id(self, dataset: str) -> None:
        minari = import_extra("minari", "Minari", "datasets")
        try:
            minari.dataset.minari_dataset.parse_dataset_id(dataset)
        except (ValueError, TypeError):  # TypeError: an id without a version.
            valid = (
                "NAMESPACE/NAME-v0 of letters, digits, - and _, such as 'rope/expert-v0'; a "
                "namespace has two or more of them, can have parts (a/b/c) and can be left out"
            )
            raise InvalidArgumentError("dataset", dataset, valid) from None

    def root(self) -> pathlib.Path:
        storage = import_extra("minari.storage", "Minari", "datasets")
        with naming(os.environ.get("MINARI_DATASETS_PATH", "the folder of Minari"), "written"):
            return storage.get_dataset_path()

    def described(self) -> dict[str, Any]:
        return {"format": "minari"}

    def load(self, dataset: str) -> Any:
        return import_extra("minari", "Minari", "datasets").load_dataset(dataset)

    def summary(self, dataset: Any) -> tuple[int, int, str]:
        call = f"minari.load_dataset({dataset.spec.dataset_id!r})"
        return dataset.total_episodes, dataset.total_steps, call

    def build(self, folder, dataset, env, episodes, about):
        minari = import_extra("minari", "Minari", "datasets")
        # `create_dataset_from_buffers` would need all episodes in memory and the final folder.
        storage = minari.dataset.minari_storage.MinariStorage.new(
            folder / "data",
            observation_space=env.observation_space,
            action_space=env.action_space,
            env_spec=env.spec,
            jpeg_encoding=False,  # JPEG is lossy.
        )
        signed = {  # Minari expects sets of authors.
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
    """Raises OSError if a folder lacks free space [bytes], as HDF5 would end the process."""
    with tempfile.TemporaryFile(dir=folder) as stream:
        stream.write(bytes(size))
        stream.flush()
        os.fsync(stream.fileno())


def _place_images(
    file: pathlib.Path, number: int, observations: np.ndarray | Mapping[str, Any]
) -> None:
    """Creates compressed HDF5 datasets for an episode's images, to which Minari appends."""
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
    """Yields all arrays of nested dicts, with their paths."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _arrays(f"{name}/{key}", inner)
    else:
        yield name, value


def chunk(array: np.ndarray) -> tuple[int, ...]:
    """Returns the shape of chunks (n, ...) with at most `_STRIPE` bytes of each frame."""
    shape = list(array.shape)
    for axis in range(1, array.ndim):
        size = int(np.prod(shape[1:])) * array.itemsize
        shape[axis] = min(shape[axis], max(1, shape[axis] * _STRIPE // size))
    return tuple(shape)
