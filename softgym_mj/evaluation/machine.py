"""Description of this machine, on which the bits of a user's own policy may depend."""

import pathlib
import platform
import re

_CPUINFO = pathlib.Path("/proc/cpuinfo")  # Linux only.


def machine() -> dict[str, str | None]:
    """Returns the model of the processor; None if unknown."""
    text = _CPUINFO.read_text() if _CPUINFO.exists() else ""
    model = re.search(r"^model name[ \t]*:[ \t]*(.*\S)", text, re.MULTILINE)
    return {"cpu": model[1] if model else platform.processor() or None}
