"""`Entity`: what has a model of its own."""

import inspect
from typing import Any

from dm_control import composer, mjcf

from softgym_mj.rendering.look import Look

UNSEEN_GEOMS = 3  # Group of geoms that are there for contact: cameras and viewers hide it.


class Entity(composer.Entity):
    """An entity whose `_build` sets `_mjcf_root`."""

    _mjcf_root: mjcf.RootElement

    def __init_subclass__(cls, **kwargs: Any):
        """Has `help` show what `_build` takes: composer's constructor takes anything."""
        super().__init_subclass__(**kwargs)
        build = vars(cls).get("_build")
        if build is None or "__init__" in vars(cls):
            return
        signature = inspect.signature(build)
        if any(one.kind is one.VAR_POSITIONAL for one in signature.parameters.values()):
            return  # It passes on what the class above takes.

        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
            super(cls, self).__init__(*args, **kwargs)

        __init__.__doc__ = build.__doc__
        __init__.__signature__ = signature  # type: ignore[attr-defined]
        cls.__init__ = __init__  # type: ignore[method-assign]

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root

    def set_look(self, look: Look) -> None:
        """Sets how it is drawn, before it is compiled."""
