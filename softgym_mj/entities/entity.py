"""`Entity`: base of everything with an MJCF model."""

import inspect
from typing import Any

from dm_control import composer, mjcf

from softgym_mj.exceptions import UnexpectedArgumentError, choices
from softgym_mj.rendering.look import Look

UNSEEN_GEOMS = 3  # Group of collision geoms that cameras and viewers hide.


class Entity(composer.Entity):
    """An entity whose `_build` sets `_mjcf_root`."""

    _mjcf_root: mjcf.RootElement

    def __init_subclass__(cls, **kwargs: Any):
        """Copies the signature of `_build` to `__init__`, for `help` and errors.

        Composer's takes anything.
        """
        super().__init_subclass__(**kwargs)
        build = vars(cls).get("_build")
        if build is None or "__init__" in vars(cls):
            return
        signature = inspect.signature(build)
        if any(one.kind is one.VAR_POSITIONAL for one in signature.parameters.values()):
            return  # The inherited signature applies.

        names = [*signature.parameters][1:]
        is_open = any(one.kind is one.VAR_KEYWORD for one in signature.parameters.values())

        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
            own, unknown = type(self), kwargs.keys() - names
            if own.__init__ is __init__ and not is_open and unknown:
                wrong = min(unknown)
                raise UnexpectedArgumentError(
                    f"{own.__name__} got an unexpected keyword argument {wrong!r}"
                    + choices(wrong, names)
                )
            super(cls, self).__init__(*args, **kwargs)

        __init__.__doc__ = build.__doc__
        __init__.__signature__ = signature  # type: ignore[attr-defined]
        cls.__init__ = __init__  # type: ignore[method-assign]

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """MJCF model of the entity."""
        return self._mjcf_root

    def set_look(self, look: Look) -> None:
        """Sets the rendering detail, before compilation."""
