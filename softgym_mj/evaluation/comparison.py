"""Comparison of results: labels and tables."""

import itertools
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from softgym_mj.evaluation.configuration import PROTOCOL
from softgym_mj.evaluation.indices import as_text
from softgym_mj.evaluation.statistics import quartiles_over, summary
from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import read_json

_NEEDED = ("protocol", "task", "policy", "variations", "seeds", "settings", "planning", "episodes")


def read_results(files: Sequence[pathlib.Path]) -> list[dict]:
    """Reads results of evaluations; duplicates are dropped.

    Summaries are computed anew by `statistics`.

    Raises:
        StoreError: for a file that is no result, is incomplete or has another protocol version;
            for no file at all.
    """
    if not files:
        raise StoreError("there are no results to plot; name the result.json of evaluations")
    output: list[dict] = []
    for file in files:
        result = _read_result(file / "result.json" if os.path.isdir(file) else file)
        if result not in output:
            output.append(result)
    return output


def _read_result(file: pathlib.Path) -> dict:
    result = read_json(file)
    try:
        missing = [key for key in _NEEDED if key not in result]
        if missing:
            raise KeyError(missing[0])
        if result["protocol"] != PROTOCOL:
            raise StoreError(
                f"{file} is of protocol version {result['protocol']!r}, which cannot be compared "
                f"with this one, {PROTOCOL}; evaluate again"
            )
        output = [(episode["seed"], episode["variation"]) for episode in result["episodes"]]
        if output != list(itertools.product(result["seeds"], result["variations"])):
            raise ValueError("its episodes are not those of its seeds and variations")
        _details(result)
        return {**result, "summary": summary(result["episodes"])}
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise StoreError(f"{file} is not the result of an evaluation: {error!r}") from error


def labels(results: Sequence[Mapping]) -> list[str]:
    """Returns a label for each result: its policy and the settings that differ from others.

    Raises:
        StoreError: if two results do not differ.
    """
    names = []
    details = [_details(result) for result in results]
    for result, own in zip(results, details, strict=True):
        # Only differences within a task count: horizons differ between tasks.
        rivals = [
            theirs
            for other, theirs in zip(results, details, strict=True)
            if (other["task"], other["policy"]) == (result["task"], result["policy"])
        ]
        telling = [
            f"{key[1]}={value}"
            for key, value in own.items()
            if any(theirs.get(key) != value for theirs in rivals)
        ]
        names.append(" ".join([result["policy"], *telling]))
    kinds = [(result["task"], name) for result, name in zip(results, names, strict=True)]
    for task, name in kinds:
        if kinds.count((task, name)) > 1:
            raise StoreError(
                f"several results of {name!r} on {task} have the same settings, planning, "
                "variations and seeds but other content; leave all but one of them out"
            )
    return names


def _details(result: Mapping[str, Any]) -> dict[tuple[str, str], str]:
    """Returns the settings that labels may show, by part of the result and name."""
    parts = {
        "settings": result["settings"],
        "planning": result["planning"] or {},
        "": {"variations": as_text(result["variations"]), "seeds": as_text(result["seeds"])},
    }
    return {
        (part, key): str(value) for part, entries in parts.items() for key, value in entries.items()
    }


def rows(results: Sequence[Mapping]) -> list[dict[str, Any]]:
    """Returns a table with a row for each result: task, label, numbers and their basis."""
    return [
        {
            "task": result["task"],
            "policy": name,
            **result["summary"],
            "quartiles_over": quartiles_over(result["episodes"]),
            "variations": as_text(result["variations"]),
            "seeds": as_text(result["seeds"]),
            "episodes": len(result["episodes"]),
        }
        for result, name in zip(results, labels(results), strict=True)
    ]


def markdown(results: Sequence[Mapping]) -> str:
    """Returns a Markdown table of tasks and policies: mean and minimum score."""
    names = labels(results)
    groups = list(dict.fromkeys(names))
    scores = {(r["task"], name): r["summary"] for r, name in zip(results, names, strict=True)}
    lines = ["| task | " + " | ".join(groups) + " |", "|---" * (len(groups) + 1) + "|"]
    for task in dict.fromkeys(result["task"] for result in results):
        own = [scores.get((task, group)) for group in groups]
        cells = ["" if s is None else f"{s['mean']:z.2f} ({s['min']:z.2f})" for s in own]
        lines.append(f"| `{task}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
