"""How well the scripted experts do with every actor, over many evaluation variations.

    python -m benchmarks.experts spread_cloth,fold_cloth:franka,ur5e:8 all:all:1 --jobs 8

plays rounds in turn, each of tasks, actors and a stride: first every eighth variation of these two
tasks with two arms, then whatever is missing of all. The same command goes on where it was
stopped. In the end, and with `--collect` without playing, scores are merged into docs/experts.json,
which `make sheets` shows in README and docs. It needs no OpenGL.

Scores of different code are never mixed: each set says what it was played with (`code_sha256`), and
takes the place of one of other code where it has no fewer variations. A set is of evenly spaced
variations, whatever else was played: those that end first are not the hardest ones.
"""

import argparse
import functools
import hashlib
import os
import pathlib
import statistics
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypedDict

import mujoco

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.factory import make_policy
from softgym_mj.registry import TASKS
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.storage.files import read_json, write_json
from softgym_mj.storage.store import JSON, Store

ACTORS = ("default", *ARMS)  # Pickers or cups, arms.
FIRST, LAST = 800, 999  # Evaluation variations.
FEWEST = 5  # Variations of a set.
OPEN = 12  # Environments that a process keeps: about 40 MB each.
DIGITS = 16  # Hexadecimal ones of the digest that files show.
DOCS = pathlib.Path(__file__).parent.parent / "docs"
FILE = DOCS / "experts.json"
# Rooms of the package that no score depends on; what is written there, and all else, is code.
APART = frozenset(
    {
        "cli", "compat", "evaluation", "learning", "parallel", "reality", "recording", "rendering",
        "storage", "vector", "viewing",
    }
)  # fmt: skip
SOURCES = frozenset({".py", ".cc", ".h", ".xml", ".npz"})

Key = tuple[str, str, int]  # Task, actor, variation.


class Played(TypedDict):
    """Scores of one task and actor.

    Attributes:
        code: what they were played with, None where nobody wrote it down.
        scores: normalized performance at the end of an episode, by variation.
    """

    code: str | None
    scores: dict[str, float]


Scores = dict[str, dict[str, Played]]  # By task and actor.


class Round(NamedTuple):
    """Every `stride`-th variation of tasks with actors."""

    tasks: Sequence[str]
    actors: Sequence[str]
    stride: int

    def episodes(self) -> Iterator[Key]:
        """Its episodes, variation by variation."""
        for variation in range(FIRST, LAST + 1, self.stride):
            for task in self.tasks:
                for actor in self.actors:
                    yield task, actor, variation


def as_round(text: str) -> Round:
    """The round of "TASKS:ACTORS:STRIDE", names with commas between them or "all".

    Raises:
        InvalidArgumentError: for another form or name.
    """
    parts = text.split(":")
    if len(parts) != 3 or not parts[2].isdecimal() or int(parts[2]) == 0:
        raise InvalidArgumentError("round", text, "TASKS:ACTORS:STRIDE, as all:franka,ur5e:8")
    chosen = []
    for names, valid in ((parts[0], tuple(TASKS)), (parts[1], ACTORS)):
        chosen.append(valid if names == "all" else tuple(names.split(",")))
        for name in chosen[-1]:
            check_name("round", name, valid)
    return Round(chosen[0], chosen[1], int(parts[2]))


def code_sha256(folder: pathlib.Path | None = None) -> str:
    """The digest of what scores depend on: sources, start states and MuJoCo's version."""
    folder = folder or pathlib.Path(softgym_mj.__file__).parent
    digest = hashlib.sha256(mujoco.__version__.encode())
    for file in sorted(folder.rglob("*")):
        parts = file.relative_to(folder).parts
        if file.suffix in SOURCES and parts[0] not in APART:
            digest.update("/".join(parts).encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:DIGITS]


@functools.lru_cache(maxsize=OPEN)
def environment(task: str, actor: str) -> Environment:
    """The environment that episodes of a task with an actor are played in."""
    settings = {} if actor == "default" else {"actor": actor}
    return softgym_mj.load(task, split="all", **settings)


def play(task: str, actor: str, variation: int) -> dict[str, float]:
    """Normalized performance at the end of an episode of the expert, and the core seconds of it."""
    begun = time.process_time()
    env = environment(task, actor)
    for _ in env.play(make_policy("scripted", env, 0), variation):
        pass
    score = env.info()["normalized_performance"]
    return {"score": score, "core_s": time.process_time() - begun}


def table(scores: Scores) -> str:
    """Means, standard errors and smallest scores of the actors that have played, as Markdown.

    And the number of variations.
    """
    played = [actor for actor in ACTORS if any(actor in actors for actors in scores.values())]
    titles = ["abstract actor" if actor == "default" else f"`{actor}`" for actor in played]
    lines = [f"| task | {' | '.join(titles)} |", "|---" * (1 + len(played)) + "|"]
    for task, actors in scores.items():
        cells = []
        for actor in played:
            if actor not in actors:
                cells.append("not yet played")
                continue
            values = list(actors[actor]["scores"].values())
            error = statistics.stdev(values) / len(values) ** 0.5
            mean, number = statistics.mean(values), len(values)
            cells.append(f"{mean:.3f} ± {error:.3f} ({min(values):.2f}), {number}")
        lines.append(f"| `{task}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def evenly(scores: Mapping[int, float]) -> dict[int, float]:
    """The scores of the variations with the least stride that are all there, and no others."""
    for stride in range(1, (LAST - FIRST + 1) // FEWEST + 1):
        chosen = range(FIRST, LAST + 1, stride)
        if all(variation in scores for variation in chosen):
            return {variation: scores[variation] for variation in chosen}
    return {}


def collected(store: Store, code: str) -> Scores:
    """What a folder has, whoever played it."""
    found: Scores = {}
    for task in TASKS:
        for actor in ACTORS:
            keys = [(task, actor, v) for v in range(FIRST, LAST + 1)]
            there = {key[2]: store.get(key)["score"] for key in keys if store.has(key)}
            if scores := evenly(there):
                own: Played = {"code": code, "scores": {str(v): s for v, s in scores.items()}}
                found.setdefault(task, {})[actor] = own
    return found


def merged(old: Scores, new: Scores) -> Scores:
    """Old scores, with new ones in the place of those that have no more variations.

    What was played with the same code is the same wherever both have a variation.
    """
    result = {task: dict(old.get(task, {})) for task in sorted({*old, *new})}
    for task, actors in new.items():
        for actor, played in actors.items():
            before = result[task].get(actor)
            if before is None or len(before["scores"]) <= len(played["scores"]):
                result[task][actor] = played
    return {task: {a: own[a] for a in ACTORS if a in own} for task, own in result.items()}


def play_rounds(rounds: Iterable[Round], jobs: int, store: Store) -> None:
    """Plays what the store lacks of rounds, in their order."""
    keys = list(dict.fromkeys(key for one in rounds for key in one.episodes()))
    done = 0

    def progress(key: Key, value: Mapping[str, float]) -> None:
        nonlocal done
        done += 1
        task, actor, variation = key
        print(f"{done}/{len(keys)} {task} {actor} {variation}: "
              f"{value['score']:.3f}, {value['core_s']:.1f} core s")  # fmt: skip

    with make_executor(jobs) as executor:
        store.run(keys, play, executor, progress)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rounds", nargs="*", type=as_round, metavar="TASKS:ACTORS:STRIDE")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("build/experts"))
    parser.add_argument("--collect", action="store_true", help="play nothing, merge what is there")
    parser.add_argument("--out", type=pathlib.Path, default=FILE, help="merged into this file")
    chosen = parser.parse_args(arguments)
    os.environ.setdefault("MUJOCO_GL", "disable")
    code = code_sha256()
    store = Store(chosen.folder / code, {"code": code}, JSON)
    if not chosen.collect:
        play_rounds(chosen.rounds or [as_round("all:all:3")], chosen.jobs, store)
    new = collected(store, code)
    old: Scores = read_json(chosen.out) if chosen.out.exists() else {}
    both = merged(old, new)
    write_json(chosen.out, both)
    print(table(both))
    for task, actors in new.items():
        for actor, played in actors.items():
            if both[task][actor] is not played:
                more, fewer = len(both[task][actor]["scores"]), len(played["scores"])
                print(f"{task}, {actor}: kept {more} scores of other code before {fewer} new ones")


if __name__ == "__main__":
    main()
