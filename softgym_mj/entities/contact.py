"""`FlexContact`: keeps the flexes of a scene from passing through themselves and each other."""

from collections.abc import Mapping

from dm_control import composer, mjcf

from softgym_mj.domain import Parameter, scaled
from softgym_mj.exceptions import OutOfRangeError
from softgym_mj.native.library import CLOTH_CONTACT, load_plugin

LAYER_FRICTION = 0.75  # Between layers of cloth.
MAX_FRICTION = 5.0  # The plugin accepts twice as much; a domain may ask for 1.6 times as much.
# MuJoCo reports contacts from this distance [m] on, so that the plugin can stop vertices at the
# floor that layers above push down; it needs what a vertex falls in a step (1 mm) and some more.
GAP = 0.003

_INSTANCE = "contact"


def layer_friction(nominal: float) -> Parameter:
    """The domain parameter for the friction between layers."""
    return scaled("layer_friction", "", nominal, 1.2, 1.6, "between layers")


def add_instance(root: mjcf.RootElement) -> mjcf.Element:
    """An instance of softgym_mj.cloth_contact in a model; `set_friction` completes it."""
    load_plugin()
    instance = root.extension.add("plugin", plugin=CLOTH_CONTACT).add("instance", name=_INSTANCE)
    instance.add("config", key="friction")
    return instance


def set_friction(instance: mjcf.Element, friction: float) -> None:
    """Sets the Coulomb coefficient between the layers that an instance keeps apart."""
    instance.config[0].value = str(friction)


def keep_apart(flexcomp: mjcf.Element, instance: mjcf.Element) -> None:
    """Leaves what a flexcomp touches of flexes to an instance of the plugin."""
    flexcomp.contact.selfcollide = "none"
    flexcomp.contact.gap = GAP
    flexcomp.add("plugin", plugin=CLOTH_CONTACT, instance=instance)


class FlexContact(composer.Entity):
    """Contact of all flexes that are given it as `self_contact`, with themselves and each other.

    Attach it to the scene that they are in.
    """

    def _build(self, friction: float = LAYER_FRICTION, name: str = "contact"):
        """Builds the contact; loads the plugin.

        Args:
            friction: Coulomb coefficient between layers, above 0 and at most `MAX_FRICTION`.
            name: model name.

        Raises:
            OutOfRangeError: for a bad friction.
        """
        if not 0.0 < friction <= MAX_FRICTION:
            raise OutOfRangeError("friction", friction, f"above 0, at most {MAX_FRICTION}")
        self._mjcf_root = mjcf.RootElement(model=name)
        self._parameter = layer_friction(friction)
        self._friction = friction
        self._instance = add_instance(self._mjcf_root)
        set_friction(self._instance, friction)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root

    @property
    def instance(self) -> mjcf.Element:
        """The plugin's instance."""
        return self._instance

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Domain parameters: the friction between layers."""
        return (self._parameter,)

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets the domain parameters; True when the model changed and must be recompiled."""
        friction = values[self._parameter.name]
        if friction == self._friction:
            return False
        self._friction = friction
        set_friction(self._instance, friction)
        return True
