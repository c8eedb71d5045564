"""The machine that computes: what bits depend on besides versions."""

import os
import pathlib
import platform
from collections.abc import Sequence

_CPUINFO = pathlib.Path("/proc/cpuinfo")  # Of Linux.


def machine() -> dict[str, str | None]:
    """Model of the processor, and instruction set of the water's kernels; None where unknown."""
    facts: dict[str, str] = {}
    if _CPUINFO.exists():
        for line in _CPUINFO.read_text().splitlines():
            name, _, value = line.partition(":")
            facts.setdefault(name.strip(), value.strip())
    return {
        "cpu": facts.get("model name") or platform.processor() or None,
        "instructions": _instructions(facts["flags"].split()) if "flags" in facts else None,
    }


def _instructions(flags: Sequence[str]) -> str:
    """What `ChooseKernels` of the plugin (fluid/plugin/solver.cc) chooses, by /proc/cpuinfo."""
    asked = os.environ.get("SOFTGYM_MJ_SIMD")
    if asked == "scalar" or "fma" not in flags:
        return "scalar"
    if "avx512f" in flags and asked != "avx2":
        return "avx512"
    return "avx2" if "avx2" in flags else "scalar"
