"""Sheets and ropes that the plugin moves, in plain MuJoCo, for tests of it."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.cloth import alternating_triangles
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.native.library import load_plugin
from softgym_mj.reality.lab.meshes import bias
from softgym_mj.reality.lab.vertices import Vertices

GRAVITY = 9.81
SPACING = 0.03  # [m] Distance of vertices of cloths.
RADIUS = 0.005  # [m]
HELD_MASS = 10.0  # [kg]
TIMESTEP = 0.01  # [s]

# The softer and heavier cloth without air that most figures were first found for.
LIMP = Fabric(stretch_stiffness=500.0, bend_stiffness=1.25e-6, density=0.2, drag=0.0)
WOVEN = Fabric()
FABRICS = {"limp": LIMP, "woven": WOVEN}


@dataclasses.dataclass
class Flex:
    """A flexcomp: vertices (n, 3) [m], elements (m, dim + 1), mass [kg], the plugin's attributes.

    `inside` is XML inside the flexcomp and `contact` its attributes of contact.
    """

    points: np.ndarray
    elements: np.ndarray
    mass: float
    material: dict[str, float]
    radius: float = RADIUS
    friction: float = 1.0
    inside: str = ""
    contact: str = 'selfcollide="none" contype="0" conaffinity="0"'
    edge: str = 'equality="false" damping="1e-12"'  # Or else the compiler warns.

    def instance(self, name: str) -> str:
        """XML of the plugin's instance, with the attributes of the material."""
        config = "".join(f'<config key="{k}" value="{v}"/>' for k, v in self.material.items())
        return f'<instance name="{name}">{config}</instance>'

    def flexcomp(self, name: str) -> str:
        """XML of the flexcomp."""
        numbers = " ".join(f"{x:.9g}" for x in self.points.ravel())
        elements = " ".join(map(str, self.elements.ravel()))
        return f"""
        <flexcomp name="{name}" type="direct" dim="{self.elements.shape[1] - 1}" mass="{self.mass}"
          radius="{self.radius}" point="{numbers}" element="{elements}">
          <contact {self.contact} friction="{self.friction}"/><edge {self.edge}/>
          <plugin plugin="softgym_mj.cloth" instance="{name}"/>{self.inside}
        </flexcomp>"""


def material_of(fabric: Fabric) -> dict[str, float]:
    """The plugin's attributes for a fabric."""
    return {
        "stretch": fabric.stretch_stiffness,
        "shear": fabric.shear,
        "bend": fabric.bend_stiffness,
        "stretch_damping": fabric.stretch_damping,
        "bend_damping": fabric.bend_damping,
        "friction": fabric.layer_friction,
        "drag": fabric.drag,
    }


def grid(rows: int, columns: int) -> np.ndarray:
    """Triangles (m, 3) of a grid of squares with alternating diagonals, seen from above."""
    return alternating_triangles(rows, columns)[:, [0, 2, 1]]


def sheet(
    rows: int,
    columns: int,
    spacing: float = SPACING,
    fabric: Fabric = LIMP,
    center: Sequence[float] = (0.0, 0.0, RADIUS),
    **settings,
) -> Flex:
    """A flat cloth; vertex (row, column) is number row * columns + column, columns go along X."""
    x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    points = spacing * np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + center
    mass = fabric.density * spacing**2 * (rows - 1) * (columns - 1)
    material = material_of(fabric) | settings.pop("material", {})
    settings = {"friction": fabric.friction} | settings
    return Flex(points, grid(rows, columns), mass, material, **settings)


def bias_sheet(width: int, length: int, spacing: float, fabric: Fabric) -> Flex:
    """A strip along X, cut at 45 degrees to its mesh: sides are `width` and `length` diagonals."""
    places, triangles = bias(length, width)
    points = np.column_stack([spacing * places, np.full(len(places), RADIUS)])
    area = 2.0 * spacing**2 * width * length
    return Flex(points, triangles, fabric.density * area, material_of(fabric))


def rope(
    points: np.ndarray, density: float = 0.1, bend: float = 1.2e-5, radius: float = 0.00625,
    friction: float = 1.0, **material,
) -> Flex:  # fmt: skip
    """A rope of `density` [kg/m] through points (n, 3) [m] that are its lengths apart at rest."""
    size = len(points)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    made_of = {"stretch": 500, "stretch_damping": 5e-4, "bend": bend, "bend_damping": 2e-3,
               "friction": friction, **material}  # fmt: skip
    elements = np.column_stack([np.arange(size - 1), np.arange(1, size)])
    return Flex(points, elements, density * length, made_of, radius, friction)


def straight(count: int, spacing: float, start: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Points (count, 3) [m] along X."""
    points = np.zeros((count, 3))
    points[:, 0] = spacing * np.arange(count)
    return points + start


def model_xml(
    *flexes: Flex,
    scenery: str = "",
    floor: bool = True,
    option: str = 'integrator="Euler"',
    gravity: Sequence[float] = (0.0, 0.0, -GRAVITY),
    parent: str = "",
    settings: str = "",
    extra: str = "",
) -> str:
    """A model of flexes, called a, b, c, ..., in a body with the attributes `parent`."""
    names = [chr(ord("a") + i) for i in range(len(flexes))]
    instances = "".join(flex.instance(name) for flex, name in zip(flexes, names, strict=True))
    if settings:  # Settings of the first instance, which solves for all.
        instances = instances.replace("</instance>", settings + "</instance>", 1)
    inside = "".join(flex.flexcomp(name) for flex, name in zip(flexes, names, strict=True))
    plane = '<geom name="floor" type="plane" size="9 9 .1" friction=".01"/>' if floor else ""
    down = " ".join(map(repr, map(float, gravity)))
    body = f"<body {parent}>{inside}</body>" if parent else inside
    return f"""<mujoco><option timestep="{TIMESTEP}" gravity="{down}" {option}/>
    <size memory="64M"/>
    <extension><plugin plugin="softgym_mj.cloth">{instances}</plugin></extension>
    <worldbody>{plane}{body}{scenery}</worldbody>{extra}</mujoco>"""


class FlexScene(Vertices):
    """A model of flexes that is stepped, and whose vertices can be held.

    Attributes:
        count: steps so far.
        strain_99, lowest, hits: largest 99th percentile of an edge's elongation, lowest vertex [m]
            and most intersections of edges and triangles so far.
    """

    def __init__(self, *flexes: Flex, hit_interval: int = 10, **settings):
        """Builds it; every `hit_interval` steps intersections are counted."""
        load_plugin()
        model = mujoco.MjModel.from_xml_string(model_xml(*flexes, **settings))
        solver.forget_damping(model)
        super().__init__(model, mujoco.MjData(model))
        self.mass = np.array(model.body_mass[model.flex_vertbodyid])
        first = np.repeat(model.flex_vertadr, model.flex_edgenum)
        self.edges = model.flex_edge + first[:, None]
        self.lengths = np.array(model.flexedge_length0)
        self.triangles = np.concatenate(
            [
                np.zeros((0, 3), int),
                *(
                    model.flex_elem[a : a + 3 * n].reshape(-1, 3) + v
                    for a, n, v, dim in zip(
                        model.flex_elemdataadr, model.flex_elemnum, model.flex_vertadr,
                        model.flex_dim, strict=True,
                    )
                    if dim == 2
                ),
            ]
        )  # fmt: skip
        self.held: dict[int, np.ndarray] = {}
        self._masses: dict[int, np.ndarray] = {}
        self.count, self._hit_interval = 0, hit_interval
        self.strain_99, self.lowest, self.hits = 0.0, np.inf, 0

    def strain(self) -> np.ndarray:
        """Elongation of all edges."""
        x = self.positions()
        ends = x[self.edges[:, 0]] - x[self.edges[:, 1]]
        return np.linalg.norm(ends, axis=1) / self.lengths - 1.0

    def count_hits(self) -> int:
        """Intersections of edges and triangles now."""
        return count_intersections(self.positions(), self.edges, self.triangles)

    def hold(self, *vertices: int) -> None:
        """Holds vertices where they are."""
        for vertex in vertices:
            dofs = self.dofs[vertex]
            self.held[vertex] = self.positions()[vertex]
            self._masses[vertex] = np.array(self.model.dof_M0[dofs])
            self.model.dof_M0[dofs] = HELD_MASS

    def release(self) -> None:
        """Lets go of all vertices."""
        for vertex, mass in self._masses.items():
            self.model.dof_M0[self.dofs[vertex]] = mass
        self.held, self._masses = {}, {}

    def step(self, count: int = 1, velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        """Steps; held vertices move at a velocity [m/s]."""
        self.step_each({vertex: velocity for vertex in self.held}, count)

    def step_each(self, velocities: dict[int, Sequence[float]], count: int = 1) -> None:
        """Steps; held vertices move at velocities of their own, others stay where they are."""
        for _ in range(count):
            for vertex in self.held:
                velocity = np.asarray(velocities.get(vertex, np.zeros(3)))
                self.held[vertex] = self.held[vertex] + TIMESTEP * velocity
                way = self.held[vertex] - self.positions()[vertex]
                self.data.qvel[self.dofs[vertex]] = way / TIMESTEP
            mujoco.mj_step(self.model, self.data)
            self.count += 1
            self.strain_99 = max(self.strain_99, float(np.percentile(self.strain(), 99)))
            self.lowest = min(self.lowest, float(self.positions()[:, 2].min()))
            if self.count % self._hit_interval == 0 and len(self.triangles):
                self.hits = max(self.hits, self.count_hits())

    def follow(self, path: np.ndarray, speed: float) -> None:
        """Carries the held vertices along displacements (n, 3) [m] at a speed [m/s]."""
        ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        stops = np.arange(0.0, ways[-1] + speed * TIMESTEP, speed * TIMESTEP)
        points = np.column_stack([np.interp(stops, ways, path[:, i]) for i in range(3)])
        for way in np.diff(points, axis=0):
            self.step(1, way / TIMESTEP)


def fold(scene: FlexScene, size: int, speed: float, spacing: float = SPACING) -> None:
    """Folds the first column of a square sheet onto the last one, and lets go of it."""
    width = spacing * (size - 1)
    scene.hold(0, size * (size - 1))
    angle = np.linspace(0.0, np.pi, 500)
    # A little flatter than a circle, and down to above the lower layer.
    x, z = 0.49 * width * (1 - np.cos(angle)), 0.45 * width * np.sin(angle) + 0.012 * angle / np.pi
    scene.follow(np.column_stack([x, np.zeros_like(x), z]), speed)
    scene.release()


def crumple(scene: FlexScene, vertex: int) -> None:
    """Lifts a vertex by 0.6 m at 1 m/s, waits for 1.5 s and lets go of it."""
    scene.hold(vertex)
    scene.step(60, (0.0, 0.0, 1.0))
    scene.step(150)
    scene.release()
