"""`Entity`: what has a model of its own."""

from dm_control import composer, mjcf


class Entity(composer.Entity):
    """An entity whose `_build` sets `_mjcf_root`."""

    _mjcf_root: mjcf.RootElement

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root
