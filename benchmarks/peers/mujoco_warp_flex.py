"""MuJoCo Warp: a flex whose membrane and plate have the fabric's stiffness, with self-collision.

Settings are those of MuJoCo's own cloth models: elastic2d="both" integrated implicitly, solver CG
with a tolerance of 1e-6, contacts with solref="0.01 1" and solimp=".95 .99 .0001" (drape.xml), time
step 2 ms (the default), selfcollide="auto" with friction (cloth benchmark of MuJoCo Warp). Contacts
are constraints, because MuJoCo's passive contacts have no friction. MuJoCo Warp 3.17 keeps at most
50 contacts of a flex with itself (MJ_MAXCONPAIR), whatever its size.
"""

import math
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp as wp

from benchmarks.peers.scene import STEP, Scene
from benchmarks.peers.warp_steps import WarpSteps

TIMESTEP = 0.002  # [s] MuJoCo's default.
CONTACT = 'solref="0.01 1" solimp=".95 .99 .0001"'
HOLD = 'solref="0.004 1" solimp=".99 .999 .001"'
# Room per environment and vertex for pairs of triangles near each other, of which 14 were seen, and
# for rows of constraints, of which 2.3 were seen. A pair needs 5 kB.
PAIRS, ROWS = 20, 6


def spec(scene: Scene) -> str:
    """Returns the MJCF of a scene: the cloth hangs vertically, two equalities hold its corners."""
    fabric = scene.fabric
    # Young's modulus and thickness of a plate with this stretch and bending stiffness.
    thickness = math.sqrt(12.0 * fabric.bend_stiffness / fabric.stretch_stiffness)
    young = fabric.stretch_stiffness / thickness
    points, elements = (
        " ".join(map(repr, array.ravel().tolist())) for array in (scene.points(), scene.triangles)
    )
    holds = "".join(f'<connect body1="cloth_{i}" anchor="0 0 0" {HOLD}/>' for i in scene.held)
    return f"""
<mujoco>
  <option timestep="{TIMESTEP}" integrator="discrete" solver="CG" tolerance="1e-6"
          jacobian="sparse"/>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="{fabric.friction}" {CONTACT}/>
    <flexcomp name="cloth" type="direct" dim="2" mass="{scene.mass}" radius="{fabric.thickness / 2}"
              point="{points}" element="{elements}">
      <contact selfcollide="auto" condim="3" friction="{fabric.layer_friction}" {CONTACT}/>
      <elasticity young="{young}" poisson="0" thickness="{thickness}"
                  damping="{fabric.stretch_damping}" elastic2d="both"/>
    </flexcomp>
  </worldbody>
  <equality>{holds}</equality>
</mujoco>"""


class MujocoWarpFlex(WarpSteps):
    """A `Simulation` by MuJoCo Warp: a world per environment."""

    substeps = round(STEP / TIMESTEP)

    def __init__(self, scene: Scene, num_envs: int, device: str):
        """Compiles the model and captures a step; `device` is "cpu" or "cuda"."""
        wp.set_device(device)
        model, count = mujoco.MjModel.from_xml_string(spec(scene)), scene.num_points
        self._origin = scene.points()
        self.settings: dict[str, Any] = {
            "mujoco_warp": mujoco_warp.__version__,
            "mujoco": mujoco.__version__,
            "precision": "float32",
            "integrator": "discrete",
            "iterations": model.opt.iterations,
        }
        self._model = mujoco_warp.put_model(model)
        self._model.opt.warn_overflow = 0  # Messages of kernels would be timed; `problems` remains.
        self._data = mujoco_warp.make_data(
            model, num_envs, nconmax=PAIRS * count, njmax=ROWS * count
        )
        offsets = (scene.starts(num_envs) - self._origin).reshape(num_envs, -1)
        self._start = wp.array(offsets, dtype=float)
        self.capture()

    def _steps(self) -> None:
        for _ in range(self.substeps):
            mujoco_warp.step(self._model, self._data)

    def restart(self) -> None:
        mujoco_warp.reset_data(self._model, self._data)
        wp.copy(self._data.qpos, self._start)
        self._data.eq_active.fill_(True)

    def release(self) -> None:
        self._data.eq_active.fill_(False)

    def positions(self, number: int) -> np.ndarray:
        slides = self._data.qpos[:number].numpy().astype(float)
        return slides.reshape(number, -1, 3) + self._origin

    def problems(self) -> list[str]:
        bits = np.bitwise_or.reduce(self._data.overflow.numpy())
        return [flag.name for flag in mujoco_warp.OverflowType if bits & flag]
