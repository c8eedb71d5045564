"""PyBullet's deformables: masses and springs, explicit."""

import pathlib
import tempfile

import numpy as np
import pybullet

from benchmarks.engines.sheets import STEP, Engine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.meshes import Mesh

# [s] Springs are explicit: with the usual 2 ms those of 400 N/m and 0.1 g fly apart.
TIMESTEP = 0.00025
# [N/m] of a link over two edges for 1 N m of bending: its order of magnitude, to start with.
BEND = 1e4
_EDGE = 1.2  # A grid of springs k has a stretch of 1.2 k, as of the plugin's edges.
_FLOOR = 1.0  # [m] Thickness of the box that is the floor.


class BulletSheet:
    """A sheet in a world of its own."""

    def __init__(
        self, mesh: Mesh, fabric: Fabric, start: np.ndarray, gravity: np.ndarray, floor: bool
    ):
        """Puts the vertices at `start` (n, 3) [m]."""
        self._client = pybullet.connect(pybullet.DIRECT)
        self._say(pybullet.resetSimulation, pybullet.RESET_USE_DEFORMABLE_WORLD)
        self._say(pybullet.setGravity, *gravity.tolist())
        self._say(pybullet.setTimeStep, TIMESTEP)
        if floor:
            half = [5.0, 5.0, _FLOOR / 2]
            box = self._say(pybullet.createCollisionShape, pybullet.GEOM_BOX, halfExtents=half)
            plane = self._say(
                pybullet.createMultiBody, 0, box, basePosition=[0.0, 0.0, -_FLOOR / 2]
            )
            self._say(pybullet.changeDynamics, plane, -1, lateralFriction=1.0)
        spring = fabric.stretch_stiffness / _EDGE
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "sheet.obj"
            file.write_text(_obj(mesh))
            self._sheet = self._say(
                pybullet.loadSoftBody,
                str(file),
                mass=fabric.density * mesh.area,
                useMassSpring=1,
                useBendingSprings=1,
                useNeoHookean=0,
                springElasticStiffness=spring,
                springDampingStiffness=fabric.stretch_damping * spring,
                springDampingAllDirections=0,
                springBendingStiffness=fabric.bend_stiffness * BEND,
                useSelfCollision=1,
                useFaceContact=1,
                collisionMargin=fabric.thickness / 2,
                frictionCoeff=fabric.friction,
            )
        self._say(pybullet.resetMeshData, self._sheet, start.tolist())
        self._held: list[tuple[int, int]] = []

    def positions(self) -> np.ndarray:
        flags = pybullet.MESH_DATA_SIMULATION_MESH
        return np.array(self._say(pybullet.getMeshData, self._sheet, -1, flags=flags)[1])

    def hold(self, vertices: np.ndarray) -> None:
        for body, anchor in self._held:
            self._say(pybullet.removeConstraint, anchor)
            self._say(pybullet.removeBody, body)
        self._held = []
        for vertex, place in zip(vertices, self.positions()[vertices], strict=True):
            # A body without mass or shape, to which the vertex is bound.
            body = self._say(pybullet.createMultiBody, 0, -1, basePosition=place.tolist())
            anchor = self._say(pybullet.createSoftBodyAnchor, self._sheet, int(vertex), body, -1)
            self._held.append((body, anchor))

    def step(self, targets: np.ndarray) -> None:
        count = round(STEP / TIMESTEP)
        bodies = [body for body, _ in self._held]
        starts = [self._say(pybullet.getBasePositionAndOrientation, body)[0] for body in bodies]
        ways = [np.array(t) - s for t, s in zip(targets, starts, strict=True)]
        for part in range(count):
            for body, start, way in zip(bodies, starts, ways, strict=True):
                # Where it is at the start of a step, and how fast: that is what anchors follow.
                self._put(body, start + way * part / count, way / STEP)
            self._say(pybullet.stepSimulation)
        for body, start, way in zip(bodies, starts, ways, strict=True):
            self._put(body, start + way, np.zeros(3))

    def close(self) -> None:
        pybullet.disconnect(self._client)

    def _put(self, body: int, place: np.ndarray, velocity: np.ndarray) -> None:
        self._say(
            pybullet.resetBasePositionAndOrientation, body, place.tolist(), [0.0, 0.0, 0.0, 1.0]
        )
        self._say(pybullet.resetBaseVelocity, body, velocity.tolist())

    def _say(self, function, *arguments, **named):
        return function(*arguments, physicsClientId=self._client, **named)


def _obj(mesh: Mesh) -> str:
    """A mesh as Wavefront OBJ."""
    vertices = (f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh.points.tolist())
    faces = (f"f {a} {b} {c}\n" for a, b, c in (mesh.triangles + 1).tolist())
    return "".join((*vertices, *faces))


ENGINE = Engine(
    "bullet",
    "PyBullet 3.2.7, springs",
    BulletSheet,
    {"timestep": TIMESTEP, "bend": BEND, "edge": _EDGE},
)
