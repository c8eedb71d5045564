"""SoftGym's cameras (docs/softgym.md 1.4), which differ from this package's framing."""

from softgym_mj.entities.views import CameraPose

_ROPE = CameraPose((0.0, 0.0, 0.85), (1.0, 0.0, 0.0, 0.0))
_CLOTH = CameraPose((0.0, -0.82, 0.82), (0.9239, 0.3827, 0.0, 0.0))
_CLOTH_DROP = CameraPose((1.072, -1.1569, 0.9494), (0.7915, 0.5259, 0.1724, 0.2595))
_POUR = CameraPose((1.4, -0.1, 1.5), (0.7345, 0.1968, 0.1681, 0.6273))
CAMERAS = {  # By task.
    "transport_water": CameraPose((0.64, -0.85, 1.8), (0.9763, 0.2164, 0.0, 0.0)),
    "pour_water": _POUR,
    "pour_water_amount": _POUR,
    "straighten_rope": _ROPE,
    "rope_configuration": _ROPE,
    "spread_cloth": _CLOTH,
    "fold_cloth": _CLOTH,
    "fold_crumpled_cloth": _CLOTH,
    "drop_cloth": _CLOTH_DROP,
    "drop_fold_cloth": _CLOTH_DROP,
}
