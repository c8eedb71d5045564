"""Tables of docs/identification.md: what was recovered, of docs/identification.json."""

import json
import pathlib
from collections.abc import Callable
from typing import Any

from tools.pages import table

FILE = pathlib.Path(__file__).parent.parent / "docs" / "identification.json"
SHOWN = ("bending", "drag", "added_mass", "friction", "stretch")

Result = dict[str, Any]


def draws() -> str:
    """Table of the errors and intervals of each draw."""
    found: list[Result] = _found()["results"]
    rows = []
    for result in found:
        errors, parameters = result["errors"], result["parameters"]
        cells = [f"{result['draw']}, {'without noise' if result['exact'] else 'noisy'}"]
        cells += [_off(errors[name], parameters[name]) for name in SHOWN]
        cells.append(f"{1e3 * errors['latency']:+.1f}")
        clock_error = result["clock_error"]
        cells.append(f"{1e3 * clock_error['found']:.0f} of {1e3 * clock_error['truth']:.0f}")
        cells.append(f"{result['held_out_ratio']:.3f}")
        rows.append(f"| {' | '.join(cells)} |")
    names = " | ".join(f"{name.replace('_', ' ')} [%]" for name in SHOWN)
    return table(f"| draw | {names} | latency [ms] | clock error [ms] | held-out loss |", rows)


def counts() -> str:
    """In how many draws what is near enough."""
    summary = _found()["summary"]
    rows = []
    for exact, title in ((False, "noisy"), (True, "without noise")):
        within = summary["exact_within" if exact else "within"]
        number = summary["exact_draws" if exact else "draws"]
        if number == 0:
            continue
        for name, bound in summary["exact_bounds" if exact else "bounds"].items():
            shown = f"{1e3 * bound:.1f} ms" if name == "latency" else f"{100 * bound:.0f} %"
            rows.append(f"| {title}: {name} within {shown} | {within[name]} of {number} |")
    number = summary["draws"]
    bound = f"{summary['loss_bound']:.2f}"
    more = {
        "all of these": summary["all_within"],
        "stretch said not to be identified": summary["not_identified"].get("stretch", 0),
        f"the clock error found within {1e3 * summary['clock_error_bound']:.0f} ms, no other": (
            summary["clock_errors_found"]
        ),
        f"held-out loss at most {bound} times that at the truth": summary["held_out"],
    }
    rows += [f"| noisy: {what} | {count} of {number} |" for what, count in more.items()]
    return table("| what | draws |", rows)


def _off(error: float, found: Result) -> str:
    """Error of a value, and its interval relative to itself, in percent."""
    low, high = (100 * (found[end] / found["value"] - 1) for end in ("low", "high"))
    return f"{100 * error:+.1f} ({low:+.0f}..{high:+.0f})"


def _found() -> dict[str, Any]:
    return json.loads(FILE.read_text())


TABLES: dict[str, Callable[[], str]] = {"counts": counts, "draws": draws}
