"""Dataset formats: ids, folders and atomic writing.

A dataset and its episodes are written to a hidden folder, which is renamed at the end, so that an
interrupted recording continues from finished episodes. The specification is stored with the
dataset: the same recording returns it, another one raises an error.
"""

import abc
import json
import os
import pathlib
import re
import shutil
import urllib.parse
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

import gymnasium

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.registry import TaskRecord
from softgym_mj.storage.files import naming, read_json, write_json

EPISODES = ".episodes"  # Folder of finished episodes in an unfinished dataset.
MADE_OF = "recording.json"  # File of the specification in a dataset.
_NO_LETTER = re.compile(r"[^-\w]")  # Characters that ids must not contain.


class About(NamedTuple):
    """Metadata of a dataset; `evaluation` is JSON of the environment with evaluation variations."""

    task: TaskRecord
    policy: str
    description: str
    evaluation: str
    author: str | None
    author_email: str | None
    code_permalink: str | None


class Format(abc.ABC):
    """Dataset format of a library.

    Attributes:
        default_id: Template of ids, by task and other settings.
        is_signed: Whether datasets name their author.
        observation: Default observation.
    """

    default_id: ClassVar[str]
    is_signed: ClassVar[bool]
    observation: ClassVar[str | tuple[str, ...]]

    @abc.abstractmethod
    def check_id(self, dataset: str) -> None:
        """Raises `InvalidArgumentError` for an invalid id; `UnavailableError` without library."""

    @abc.abstractmethod
    def root(self) -> pathlib.Path:
        """Returns the folder in which the library looks for datasets."""

    @abc.abstractmethod
    def build(
        self,
        folder: pathlib.Path,
        dataset: str,
        env: gymnasium.Env,
        episodes: Iterable[Mapping[str, Any]],
        about: About,
    ) -> None:
        """Writes a dataset to an empty folder, one episode after the other.

        Args:
            folder: Folder that will be moved to the dataset's place.
            dataset: Id of the dataset.
            env: Environment of the episodes.
            episodes: Values of `episodes.nested`, with "seed" and "options" of the reset.
            about: Metadata of the dataset.
        """

    @abc.abstractmethod
    def load(self, dataset: str) -> Any:
        """Returns a dataset, as the library reads it."""

    @abc.abstractmethod
    def summary(self, dataset: Any) -> tuple[int, int, str]:
        """Returns numbers of episodes and env steps of a dataset, and the call that loads it."""

    @abc.abstractmethod
    def described(self) -> dict[str, Any]:
        """Returns the format and its options, as JSON, for the specification of a dataset."""

    def check_observed(self, env: gymnasium.Env) -> None:  # noqa: B027
        """Raises `InvalidArgumentError` for observations that the format cannot store."""

    def check_signed(self, *signed: str | None) -> None:
        """Raises `InvalidArgumentError` for an author if the format does not store one."""
        if not self.is_signed and any(word is not None for word in signed):
            valid = "None: Hugging Face asks for them when a dataset is published"
            raise InvalidArgumentError("author, author_email, code_permalink", signed, valid)

    def place(self, dataset: str) -> pathlib.Path:
        """Returns the folder of a dataset, which need not exist."""
        return self.root() / dataset

    def unfinished(self, dataset: str) -> pathlib.Path:
        """Returns the hidden folder of an unfinished dataset.

        Raises:
            StoreError: if the folders cannot be written.
        """
        place = self.place(dataset)
        unfinished = self.root() / f".{urllib.parse.quote(dataset, safe='')}.unfinished"
        with naming(place, "written"):
            if (place / EPISODES).exists():
                place.rename(unfinished)
        return unfinished

    def is_finished(self, dataset: str, made_of: Mapping[str, Any]) -> bool:
        """Returns whether a finished dataset of this specification exists.

        Args:
            dataset: Id of the dataset.
            made_of: Specification: all that its episodes depend on; JSON.

        Raises:
            UnavailableError: if the library is missing.
            StoreError: if a dataset of this id has another specification.
        """
        place = self.place(dataset)
        if not os.path.lexists(place) or (place / EPISODES).exists():
            return False
        file = place / MADE_OF
        result = read_json(file) if file.exists() else {}
        own = json.loads(json.dumps(made_of))  # JSON has no tuples.
        if differ := [name for name in {**own, **result} if result.get(name) != own.get(name)]:
            raise StoreError(
                f"dataset={dataset!r} exists with different {', '.join(differ)}; choose another "
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
        """Writes a dataset atomically, in its `unfinished` folder.

        Args:
            made_of: Specification, as in `is_finished`.
            dataset, env, episodes, about: Arguments of `build`.

        Raises:
            StoreError: if it cannot be written; the partial dataset is removed.
        """
        place, unfinished = self.place(dataset), self.unfinished(dataset)
        _clear(unfinished)  # A killed process may have left a partial dataset.
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
    """Removes all but the finished episodes."""
    for path in unfinished.glob("*"):
        if path.name == EPISODES:
            continue
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def letters(*words: str | None) -> str:
    """Returns the words that are not None, joined by hyphens to a part of a dataset id."""
    return _NO_LETTER.sub("-", "-".join(filter(None, words)))
