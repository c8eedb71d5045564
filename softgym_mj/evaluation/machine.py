"""The machine that computes: what the bits of a user's own policy may depend on."""

import pathlib
import platform
import re

_CPUINFO = pathlib.Path("/proc/cpuinfo")  # Of Linux.


def machine() -> dict[str, str | None]:
    """Model of the processor; None where unknown."""
    text = _CPUINFO.read_text() if _CPUINFO.exists() else ""
    model = re.search(r"^model name[ \t]*:[ \t]*(.*\S)", text, re.MULTILINE)
    return {"cpu": model[1] if model else platform.processor() or None}
