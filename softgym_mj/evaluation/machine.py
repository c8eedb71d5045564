"""The machine that computes: what bits depend on besides versions."""

import pathlib
import platform

_CPUINFO = pathlib.Path("/proc/cpuinfo")  # Of Linux.


def machine() -> dict[str, str | None]:
    """Model of the processor; None where unknown."""
    model = None
    if _CPUINFO.exists():
        for line in _CPUINFO.read_text().splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                model = value.strip()
                break
    return {"cpu": model or platform.processor() or None}
