"""A sheet in stock MuJoCo: its own flex, held by welds to bodies that are told where to go.

`Flex.published` is as the rags' benchmark has it: edges as equalities, bending as a shell's, steps
of 10 ms. `Flex.shell` is a shell of finite elements with a fabric's stretch and bending, in air.
"""

import dataclasses
import math

import mujoco
import numpy as np

from softgym_mj.cloth import fabrics
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.recorder import Recorder, Replay
from softgym_mj.reality.replay import Hold, stepped

POISSON = 0.2  # Of a shell: between wool-lycra and wool, as measured.
AIR = 'density="1.2" viscosity="1.8e-5"'  # [kg/m^3], [Pa s]
DAMPING = 1e-3  # [s] Of a shell's elasticity, as that of ours along edges.
RADIUS = 0.005  # [m]


@dataclasses.dataclass(frozen=True)
class Flex:
    """What MuJoCo is told.

    Attributes:
        option: attributes of MJCF's `option`.
        radius: of the flex [m].
        inside: elements of the flexcomp.
    """

    option: str
    radius: float
    inside: str

    @classmethod
    def published(cls, young: float, thickness: float, poisson: float, damping: float) -> "Flex":
        """As in the benchmark's XML; Young's modulus [Pa], thickness [m], damping of edges."""
        return cls(
            'timestep="0.01" integrator="discrete" viscosity="0.3" solver="CG" tolerance="1e-6"',
            0.01,
            f'<edge equality="true" damping="{damping!r}"/><contact solref="0.003"/>'
            f'<elasticity young="{young!r}" poisson="{poisson!r}" thickness="{thickness!r}" '
            'elastic2d="bend"/>',
        )

    @classmethod
    def shell(cls, stretch: float, bending: float, friction: float, step: float) -> "Flex":
        """With E t = stretch [N/m] and B = E t^3 / (12 (1 - nu^2)) [N m], in steps [s]."""
        thickness = math.sqrt(12.0 * (1.0 - POISSON**2) * bending / stretch)
        return cls(
            f'timestep="{step!r}" integrator="discrete" solver="CG" tolerance="1e-6" {AIR}',
            RADIUS,
            f'<edge equality="false"/><contact condim="3" friction="{friction!r}" solref="0.01"/>'
            f'<elasticity young="{stretch / thickness!r}" poisson="{POISSON}" '
            f'thickness="{thickness!r}" damping="{DAMPING!r}" elastic2d="both"/>',
        )


def replay(
    mesh: Mesh,
    flex: Flex,
    mass: float,
    hold: Hold,
    times: np.ndarray,
    *,
    start: np.ndarray,
    begin: float,
    floor: float,
) -> Replay:
    """As `softgym_mj.reality.replay.replay`; of a sheet's mass [kg], with one hold for ever."""
    model = mujoco.MjModel.from_xml_string(_xml(mesh, flex, mass, hold, start, floor))
    data = mujoco.MjData(model)
    bodies = np.array(model.flex_vertbodyid)
    step = model.opt.timestep
    recorder = Recorder(mesh, times, floor)
    recorder.start(begin, start)
    ends = begin + step * np.arange(1, round((times[-1] - begin) / step) + 1)
    path = hold.path(ends)
    slides = model.jnt_qposadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
    for end, places in zip(ends, path, strict=True):
        data.mocap_pos[:] = places
        took = stepped(model, data)
        if took is None:
            recorder.fail(float(end))
            break
        if not recorder.add(float(end), model.body_pos[bodies] + data.qpos[slides], took):
            break
    return recorder.replay()


def _xml(mesh: Mesh, flex: Flex, mass: float, hold: Hold, start: np.ndarray, floor: float) -> str:
    """A sheet at its start, which MuJoCo takes for its shape at rest: it must not be strained."""
    points = " ".join(f"{x:.9g}" for x in start.ravel())
    elements = " ".join(map(str, mesh.triangles.ravel()))
    hands = "".join(
        f'<body name="hand{i}" mocap="true" pos="{" ".join(f"{x:.9g}" for x in start[vertex])}"/>'
        for i, vertex in enumerate(hold.vertices)
    )
    welds = "".join(
        f'<weld body1="hand{i}" body2="sheet_{vertex}"/>' for i, vertex in enumerate(hold.vertices)
    )
    return f"""<mujoco><option gravity="0 0 {-fabrics.GRAVITY}" {flex.option}/><size memory="64M"/>
    <worldbody><geom type="plane" size="9 9 .1" pos="0 0 {floor}" friction="0.001"/>{hands}
    <flexcomp name="sheet" type="direct" dim="2" mass="{mass!r}" radius="{flex.radius!r}"
        point="{points}" element="{elements}">{flex.inside}</flexcomp>
    </worldbody><equality>{welds}</equality></mujoco>"""
