"""`Parametric`: base of the parts of a scene with domain parameters."""

import abc
import functools
from collections.abc import Mapping

from softgym_mj.variations.randomization import Parameter


class Parametric(abc.ABC):
    """Part of a scene with domain parameters, an `Adjustable`.

    Attributes:
        parameters: its domain parameters.
    """

    parameters: tuple[Parameter, ...]

    @functools.cached_property
    def _values(self) -> dict[str, float]:
        """Values of the domain parameters by name, initially nominal."""
        return {parameter.name: parameter.nominal for parameter in self.parameters}

    @abc.abstractmethod
    def _set_parameters(self) -> None:
        """Writes `_values` into the model."""

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets the domain parameters; returns True if the model changed and must be recompiled."""
        if values == self._values:
            return False
        self._values = dict(values)
        self._set_parameters()
        return True
