"""`Parametric`: the parts of a scene that have domain parameters in their model."""

import abc
import functools
from collections.abc import Mapping

from softgym_mj.variations.randomization import Parameter


class Parametric(abc.ABC):
    """A part of a scene with domain parameters, an `Adjustable`.

    Attributes:
        parameters: its domain parameters.
    """

    parameters: tuple[Parameter, ...]

    @functools.cached_property
    def _values(self) -> dict[str, float]:
        """The domain parameters by name: nominal at first."""
        return {parameter.name: parameter.nominal for parameter in self.parameters}

    @abc.abstractmethod
    def _set_parameters(self) -> None:
        """Writes `_values` into the model."""

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets the domain parameters; True when the model changed and must be recompiled."""
        if values == self._values:
            return False
        self._values = dict(values)
        self._set_parameters()
        return True
