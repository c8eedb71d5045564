"""A column of water in an open box."""

import mujoco
import numpy as np

from softgym_mj.native.library import load_plugin

SPACING = 0.018
MOCAP = 'mocap="true"'


def cup_geoms(length, width, wall, height, base=0.0):
    """MJCF of the five boxes of a cup with inner floor length x width; its floor at z = base."""
    b = wall
    boxes = [
        ((0, 0, base - b / 2), (length / 2 + b, width / 2 + b, b / 2)),
        ((-(length + b) / 2, 0, base + height / 2), (b / 2, width / 2 + b, height / 2)),
        (((length + b) / 2, 0, base + height / 2), (b / 2, width / 2 + b, height / 2)),
        ((0, -(width + b) / 2, base + height / 2), (length / 2, b / 2, height / 2)),
        ((0, (width + b) / 2, base + height / 2), (length / 2, b / 2, height / 2)),
    ]
    return "".join(
        f'<geom type="box" pos="{p[0]} {p[1]} {p[2]}" size="{s[0]} {s[1]} {s[2]}" '
        'contype="0" conaffinity="0" mass="0.1"/>'
        for p, s in boxes
    )


class FluidCup:
    """A cup with its floor at z = 0 (mocap unless `body` says otherwise), full of a lattice.

    Further keywords, or `settings`, are attributes of the plugin.
    """

    def __init__(
        self, columns, layers, *, spacing=SPACING, wall=0.01, height=None, timestep=0.01,
        body=MOCAP, joint="", inside="", option="", actuator="", scenery="", base=0.0,
        settings=None, **config,
    ):  # fmt: skip
        load_plugin()
        nx, ny = columns
        self.count = nx * ny * layers
        self.length, self.width = nx * spacing, ny * spacing
        self.height = height or 1.6 * layers * spacing + 0.05
        attributes = {
            "count": self.count,
            "spacing": spacing,
            "columns": f"{nx} {ny}",
            "corner": f"{-(nx - 1) * spacing / 2} {-(ny - 1) * spacing / 2} {spacing / 2}",
            **config,
            **(settings or {}),
        }
        keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in attributes.items())
        geoms = cup_geoms(self.length, self.width, wall, self.height, base)
        self.xml = f"""
        <mujoco><option timestep="{timestep}" {option}/>
        <extension><plugin plugin="softgym_mj.fluid"><instance name="water">{keys}</instance>
        </plugin></extension>
        <worldbody>{scenery}<body name="cup" pos="0 0 {-base}" {body}>{joint}{geoms}{inside}
        <plugin instance="water"/></body></worldbody>{actuator}</mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.data = mujoco.MjData(self.model)

    @property
    def state(self):
        """The plugin's part of the state, a view."""
        return self.data.plugin_state

    @property
    def positions(self):
        """(count, 3) [m], a view."""
        return self.state[1 : 1 + 3 * self.count].reshape(-1, 3)

    @property
    def velocities(self):
        """(count, 3) [m/s], a view."""
        return self.state[1 + 3 * self.count : 1 + 6 * self.count].reshape(-1, 3)

    def step(self, count=1):
        mujoco.mj_step(self.model, self.data, count)

    def in_cup_frame(self):
        """Particle positions relative to a cup that is only moved, not turned."""
        return self.positions - self.data.mocap_pos[0]

    def escaped(self):
        """Which particles are not above the cup's floor and between its walls."""
        x = self.in_cup_frame()
        beyond = (np.abs(x[:, 0]) > self.length / 2) | (np.abs(x[:, 1]) > self.width / 2)
        return beyond | (x[:, 2] < 0)

    def speed(self):
        """Root mean square speed [m/s]."""
        return np.sqrt((self.velocities**2).sum(axis=1).mean())
