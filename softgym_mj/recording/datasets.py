"""Datasets, of whatever format: ids, folders, whole or not there at all.

A dataset is made in a hidden folder beside its place. The episodes that were played are in there,
too, until it is moved to its place. Who was killed in between finds them and goes on, with all of
them. What it is made of stays beside it: the same recording once more finds it, another one cannot
take it for its own.
"""

import abc
import json
import os
import pathlib
import re
import shutil
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

import gymnasium

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.registry import TaskRecord
from softgym_mj.storage.files import naming, read_json, write_json

EPISODES = ".episodes"  # In the folder of a dataset that is not finished.
MADE_OF = "recording.json"  # In the folder of a dataset.
_NO_LETTER = re.compile(r"[^-\w]")  # What an id cannot have.


class About(NamedTuple):
    """What a dataset says of itself.

    Attributes:
        task: whose episodes it has.
        policy: that played them.
        description: in words.
        evaluation: the environment with evaluation variations, as JSON.
        author, author_email, code_permalink: see `recording.record`.
    """

    task: TaskRecord
    policy: str
    description: str
    evaluation: str
    author: str | None
    author_email: str | None
    code_permalink: str | None


class Format(abc.ABC):
    """A library's way to keep datasets.

    Attributes:
        default_id: of a dataset, by task and whatever else tells it from others.
        is_signed: whether a dataset says who made it.
        observation: what is usually observed.
    """

    default_id: ClassVar[str]
    is_signed: ClassVar[bool]
    observation: ClassVar[str | tuple[str, ...]]

    @abc.abstractmethod
    def check_id(self, dataset: str) -> None:
        """Raises `InvalidArgumentError` unless it is an id; `UnavailableError` without library."""

    @abc.abstractmethod
    def root(self) -> pathlib.Path:
        """The folder in which the library looks for datasets."""

    @abc.abstractmethod
    def build(
        self,
        folder: pathlib.Path,
        dataset: str,
        env: gymnasium.Env,
        episodes: Iterable[Mapping[str, Any]],
        about: About,
    ) -> None:
        """Makes a dataset in an empty folder, one episode after the other.

        Args:
            folder: which will be moved to the dataset's place.
            dataset: its id.
            env: where the episodes were played.
            episodes: as `episodes.nested` gives them, with "seed" and "options" of the reset.
            about: what it says of itself.
        """

    @abc.abstractmethod
    def load(self, dataset: str) -> Any:
        """A dataset, as the library reads it."""

    @abc.abstractmethod
    def summary(self, dataset: Any) -> tuple[int, int, str]:
        """Of what `load` returned: numbers of episodes and env steps, the call that loads it."""

    @abc.abstractmethod
    def described(self) -> dict[str, Any]:
        """The format with its options, as JSON: part of what a dataset is made of."""

    def check_observed(self, env: gymnasium.Env) -> None:  # noqa: B027
        """Raises `InvalidArgumentError` for what it cannot keep of what an environment observes."""

    def check_signed(self, *signed: str | None) -> None:
        """Raises `InvalidArgumentError` for an author where a dataset does not say who made it."""
        if not self.is_signed and any(word is not None for word in signed):
            valid = "None: what Hugging Face shows is said when a dataset is published"
            raise InvalidArgumentError("author, author_email, code_permalink", signed, valid)

    def place(self, dataset: str) -> pathlib.Path:
        """The folder of a dataset, which need not be there."""
        return self.root() / dataset

    def unfinished(self, dataset: str) -> pathlib.Path:
        """Where a dataset is made; beside the datasets, hidden from the library.

        Raises:
            StoreError: if the folders cannot be written.
        """
        place = self.place(dataset)
        unfinished = self.root() / f".{dataset.replace('/', '.')}.unfinished"
        with naming(place, "written"):
            if (place / EPISODES).exists():
                place.rename(unfinished)
        return unfinished  # No id has a point in it.

    def is_finished(self, dataset: str, made_of: Mapping[str, Any]) -> bool:
        """Whether there is a whole dataset that is made of this.

        Args:
            dataset: its id.
            made_of: everything that its episodes depend on; JSON.

        Raises:
            UnavailableError: if the library is missing.
            StoreError: if there is one of this id that is made of something else.
        """
        place = self.place(dataset)
        if not os.path.lexists(place) or (place / EPISODES).exists():
            return False
        file = place / MADE_OF
        result = read_json(file) if file.exists() else {}
        own = json.loads(json.dumps(made_of))  # Tuples are lists there.
        if differ := [name for name in {**own, **result} if result.get(name) != own.get(name)]:
            raise StoreError(
                f"dataset={dataset!r} exists, with another {', '.join(differ)}; choose another "
                f"id, or delete {place}"
            )
        return True

    def write(
        self,
        dataset: str,
        made_of: Mapping[str, Any],
        env: gymnasium.Env,
        episodes: Iterable[Mapping[str, Any]],
        about: About,
    ) -> Any:
        """Writes a dataset, of an `unfinished` folder; it is there whole or not at all.

        Args:
            made_of: as of `is_finished`.
            dataset, env, episodes, about: as of `build`.

        Raises:
            StoreError: if it cannot be written; what was there of it is removed.
        """
        place, unfinished = self.place(dataset), self.unfinished(dataset)
        _clear(unfinished)  # Of what a killed process left.
        try:
            with naming(place, "written"):
                self.build(unfinished, dataset, env, episodes, about)
                write_json(unfinished / MADE_OF, made_of)
                place.parent.mkdir(parents=True, exist_ok=True)
                unfinished.rename(place)
                shutil.rmtree(place / EPISODES)
        except BaseException:
            _clear(unfinished)
            raise
        return self.load(dataset)


def _clear(unfinished: pathlib.Path) -> None:
    """Leaves nothing but the episodes."""
    for path in unfinished.glob("*"):
        if path.name == EPISODES:
            continue
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def letters(*words: str | None) -> str:
    """Words, but for those that are None, as part of an id."""
    return _NO_LETTER.sub("-", "-".join(filter(None, words)))
