"""Table of ACT policies that LeRobot trained: docs/lerobot.json."""

import json
import pathlib

from tools.pages import table

_FILE = pathlib.Path(__file__).parent.parent / "docs" / "lerobot.json"


def scores() -> str:
    """Scores over 200 evaluation variations, and those of other ways to execute the actions."""
    rows = []
    for own in json.loads(_FILE.read_text())["policies"]:
        first, *others = (own["scores"][name] for name in ("every1", "ensemble", "every4"))
        interval = f"{first['mean_low']:.2f} to {first['mean_high']:.2f}"
        cells = [f"`{own['teacher']}`", f"{own['updates']:,}", f"{own['minutes']:.0f}"]
        cells += [f"{first['mean']:.2f} ({interval})", f"{first['median']:.2f}"]
        cells += [f"{first['success_rate']:.2f}", *(f"{each['mean']:.2f}" for each in others)]
        rows.append(f"| `{own['task']}` | {own['observation']} | {' | '.join(cells)} |")
    figures = (
        "mean (95 %) | median | success | mean, temporal ensembling | mean, four actions at once"
    )
    return table(f"| task | observations | teacher | updates | minutes | {figures} |", rows)
