"""Domain parameters: what a variation may change besides the initial state.

A task's `domain` sets which parameters of its scene vary, and their ranges. Each is drawn for every
variation from a generator seeded with the parameter's name and the variation's index: an index
gives the same scene on every machine, whichever other parameters vary.
"""

import colorsys
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.variations import fabric_statistics
from softgym_mj.variations.indices import generator

Range = tuple[float, float]

PRESETS = {
    "nominal": "nothing varies",
    "in_distribution": "every parameter within its usual range",
    "out_of_distribution": "every parameter outside of its usual range, within the valid one",
}
FABRICS = "fabrics"  # Instead of a preset: sheets of random fabrics.
KINDS = {
    "physics": "changes motion",
    "visual": "changes images only",
    "sensor": "faults of the sensor, in images; as visual if not given",
}


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Parameter of the scene that may vary.

    Attributes:
        name: its name.
        unit: its unit.
        nominal: default value.
        usual: range of the preset "in_distribution"; presets leave a parameter nominal if this is
            the nominal value alone.
        valid: accepted range, in which the simulation was tested.
        summary: description.
        kind: one of `KINDS`.
    """

    name: str
    unit: str
    nominal: float
    usual: Range
    valid: Range
    summary: str
    kind: str = "physics"

    def ranges(self, setting: object) -> tuple[Range, ...]:
        """Returns the ranges to draw from.

        Args:
            setting: a number, a pair (low, high) or one of `PRESETS`.

        Raises:
            InvalidArgumentError: if it is none of these or not within `valid`.
        """
        if isinstance(setting, str):
            check_name(self.name, setting, PRESETS)
            if setting == "nominal":
                return ((self.nominal, self.nominal),)
            if setting == "in_distribution":
                return (self.usual,)
            if self.usual == (self.nominal, self.nominal):  # It varies only by name.
                return (self.usual,)
            outside = ((self.valid[0], self.usual[0]), (self.usual[1], self.valid[1]))
            return tuple((low, high) for low, high in outside if low < high)
        pair: Any = setting if isinstance(setting, Sequence) else (setting, setting)
        try:
            low, high = (math.nan if isinstance(value, bool) else float(value) for value in pair)
        except (TypeError, ValueError):
            low, high = math.nan, math.nan
        if not self.valid[0] <= low <= high <= self.valid[1]:
            unit = f" {self.unit}" if self.unit else ""
            valid = f"a number or (low, high) within {self.valid}{unit}, or a preset"
            raise InvalidArgumentError(self.name, setting, f"{valid}: {', '.join(PRESETS)}")
        return ((low, high),)

    def at(self, fraction: float, ranges: Sequence[Range]) -> float:
        """Returns the value at a fraction in 0..1 of the ranges' total length.

        Positive parameters are interpolated in their logarithm.
        """
        forth, back = (math.log, math.exp) if self.valid[0] > 0.0 else (float, float)
        scaled = [(forth(low), forth(high)) for low, high in ranges]
        rest = fraction * sum(high - low for low, high in scaled)
        for (low, high), (first, last) in zip(scaled, ranges, strict=True):
            if rest <= high - low:
                return min(max(back(low + rest), first), last)
            rest -= high - low
        return ranges[-1][1]


def scaled_parameter(
    name: str,
    unit: str,
    nominal: float,
    usual: float,
    valid: float,
    summary: str,
    kind: str = "physics",
) -> Parameter:
    """Returns a positive parameter that varies by the factors `usual` and `valid`, down and up."""
    within, accepted = ((nominal / factor, nominal * factor) for factor in (usual, valid))
    return Parameter(name, unit, nominal, within, accepted, summary, kind)


def shifted_parameter(
    name: str, unit: str, usual: float, valid: float, summary: str, kind: str = "physics"
) -> Parameter:
    """Returns a parameter that is nominally 0 and varies by +-`usual` and +-`valid`."""
    return Parameter(name, unit, 0.0, (-usual, usual), (-valid, valid), summary, kind)


def choice_parameter(name: str, choices: Sequence[str], usual: int, summary: str) -> Parameter:
    """Returns a visual parameter whose integer part selects a choice; the first is nominal.

    The first `usual` choices are in distribution. `decode_choice` derives further randomness from
    the fractional part.
    """
    listed = ", ".join(f"{i} {choice}" for i, choice in enumerate(choices))
    valid = (0.0, float(len(choices)))
    return Parameter(name, "", 0.0, (0.0, float(usual)), valid, f"{summary}: {listed}", "visual")


def decode_choice(value: float, number: int) -> tuple[int, int]:
    """Returns the selected one of `number` choices, and a seed from the fractional part."""
    index = min(int(value), number - 1)
    return index, int((value - index) * 2**32)


def tinted(
    color: Sequence[float], hue: float = 0.0, saturation: float = 0.0, brightness: float = 1.0
) -> tuple[float, ...]:
    """Returns a changed color (r, g, b) or (r, g, b, a) in 0..1; unchanged by default.

    The hue is rotated [deg], the saturation added to, the brightness a factor.
    """
    if (hue, saturation, brightness) == (0.0, 0.0, 1.0):
        return tuple(color)
    turn, own, value = colorsys.rgb_to_hsv(*color[:3])
    new = (turn + hue / 360.0) % 1.0, min(own + saturation, 1.0), min(value * brightness, 1.0)
    return (*colorsys.hsv_to_rgb(*new), *color[3:])


class Adjustable(Protocol):
    """Part of a scene with parameters."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that may vary."""
        ...

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets all parameters; returns True if the model changed and must be recompiled."""
        ...


class Prefixed:
    """Part whose parameters' names have a prefix: one of several in a scene.

    Attributes:
        parameters: parameters that may vary.
    """

    def __init__(self, part: Adjustable, prefix: str):
        """Prefixes the names of a part's parameters with `prefix` and an underscore."""
        self._part = part
        self._names = {f"{prefix}_{p.name}": p.name for p in part.parameters}
        renamed = zip(part.parameters, self._names, strict=True)
        self.parameters = tuple(dataclasses.replace(p, name=name) for p, name in renamed)

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets all parameters; returns True if the model changed and must be recompiled."""
        return self._part.adjust({own: values[name] for name, own in self._names.items()})


def _sheets(named: Mapping[str, Parameter]) -> tuple[str, ...]:
    """Returns the prefixes of parameters for each sheet that has all of a fabric's.

    Raises:
        InvalidArgumentError: if there is no sheet.
    """
    starts = [name.removesuffix("bend_weft") for name in named if name.endswith("bend_weft")]
    sheets = tuple(s for s in starts if all(s + own in named for own in fabric_statistics.RANGES))
    if not sheets:
        raise InvalidArgumentError(
            "domain", FABRICS, f"one of {[*PRESETS]}; {FABRICS!r} needs a task with cloth"
        )
    return sheets


class DomainRandomization:
    """Parameters of a scene that vary, and their ranges.

    Attributes:
        parameters: all of the scene, whether they vary or not.
        ranges: ranges from which each parameter is drawn.
        varying: names of the parameters that are not nominal in every variation.
        values: current value of every parameter.
    """

    def __init__(self, setting: str | Mapping[str, object], parts: Sequence[Adjustable]):
        """Reads a setting.

        Args:
            setting: one of `PRESETS` for all parameters, or a dict from names of parameters to a
                number, a pair (low, high) or a preset, and from `KINDS` to a preset for the unnamed
                parameters of the kind; others stay nominal. "fabrics", or {"physics": "fabrics"},
                draws the parameters of `fabric_statistics` together, for each sheet.
            parts: parts of the scene with parameters.

        Raises:
            InvalidArgumentError: for a bad name or value; for fabrics without a sheet.
        """
        self._parts = tuple(parts)
        named = {p.name: p for part in parts for p in part.parameters}
        if isinstance(setting, str) and setting == FABRICS:
            setting = {"physics": FABRICS}
        self._sheets: tuple[str, ...] = ()
        if isinstance(setting, Mapping):
            for name in setting:
                check_name("domain parameter", name, (*named, *KINDS))
            kinds = {kind: setting.get(kind, "nominal") for kind in KINDS}
            kinds["sensor"] = setting.get("sensor", kinds["visual"])
            if kinds["physics"] == FABRICS:
                kinds["physics"], self._sheets = "nominal", _sheets(named)
            for kind, preset in kinds.items():
                valid = (*PRESETS, FABRICS) if kind == "physics" else PRESETS
                check_name(kind, preset, valid)
            settings = {name: setting.get(name, kinds[p.kind]) for name, p in named.items()}
        elif setting in PRESETS:
            settings = dict.fromkeys(named, setting)
        else:
            choices = [*PRESETS, FABRICS, "a dict of " + ", ".join((*KINDS, *named))]
            raise InvalidArgumentError("domain", setting, choices)
        self.parameters = tuple(named.values())
        self.ranges = {p.name: p.ranges(settings[p.name]) for p in self.parameters}
        # Named parameters override the fabric's.
        self._drawn = {
            sheet: {
                own: sheet + own
                for own in fabric_statistics.RANGES
                if isinstance(setting, Mapping) and sheet + own not in setting
            }
            for sheet in self._sheets
        }
        for names in self._drawn.values():
            for own, name in names.items():
                self.ranges[name] = (fabric_statistics.RANGES[own],)
        self.varying = tuple(
            p.name for p in self.parameters if self.ranges[p.name] != ((p.nominal, p.nominal),)
        )
        self.values = {p.name: p.nominal for p in self.parameters}

    def draw(self, variation: int) -> dict[str, float]:
        """Returns the value of every parameter in a variation."""
        values = {
            p.name: p.at(generator(f"domain/{p.name}", variation).random(), self.ranges[p.name])
            for p in self.parameters
        }
        for sheet, names in self._drawn.items():
            fabric = fabric_statistics.draw(generator(f"domain/{sheet}{FABRICS}", variation))
            values.update({name: fabric[own] for own, name in names.items()})
        return values

    def apply(self, variation: int) -> bool:
        """Sets the parameters of a variation; returns True if the model must be recompiled."""
        self.values = self.draw(variation)
        changed = [
            part.adjust({p.name: self.values[p.name] for p in part.parameters})
            for part in self._parts
        ]
        return any(changed)
