"""`Entity`: what has a model of its own."""

from dm_control import composer, mjcf

from softgym_mj.rendering.look import Look

UNSEEN_GEOMS = 3  # Group of geoms that are there for contact: cameras and viewers hide it.


class Entity(composer.Entity):
    """An entity whose `_build` sets `_mjcf_root`."""

    _mjcf_root: mjcf.RootElement

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root

    def set_look(self, look: Look) -> None:
        """Sets how it is drawn, before it is compiled."""
