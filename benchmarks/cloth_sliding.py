"""How a cloth slides on the floor, with each kind of contact with itself, beside what Coulomb says.

    OMP_NUM_THREADS=1 python benchmarks/cloth_sliding.py

slope: gravity is tilted, so that the floor is a slope; the way in 5 s and the speed at the end.
stop: the whole cloth gets a speed; its way until it stops, over Coulomb's.
drag: an edge is lifted by 3 cm and pulled along; the friction that MuJoCo reports (and the normal
    force) over the weight, a part of which hangs on the edge, and the 99th percentile of strain.
"""

import argparse

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth

MODES = ("plugin", "mujoco", "none")
DIMS = (60, 60)  # SoftGym particles: 13 x 13 vertices of the default fidelity.
GRAVITY, FRICTION = 9.81, 1.0  # [m/s^2], nominal
SLOPES = (0.85, 0.95, 1.05, 1.15, 1.3, 2.0, 4.0)  # Tangents.
SPEEDS = (0.25, 0.5, 1.0)  # [m/s]
DRAGS = (0.03, 0.1, 0.3, 0.6, 1.0)  # [m/s]
SETTLING, SLIDING, STOPPING = 1.0, 5.0, 1.5  # [s]
LIFT, LIFT_STEPS, DRAG_STEPS, COUNTED = 0.03, 20, 100, 40  # [m]; the last steps count.


class FlatCloth:
    """A cloth that lies flat on the floor, and its physics."""

    def __init__(self, mode: str, timestep: float | None):
        self.cloth = Cloth(dims=DIMS, self_contact=mode)
        arena = Arena(camera="cloth")
        arena.attach(self.cloth)
        self._physics = arena.compile(self.cloth.timestep, self.cloth)  # Owns the model.
        self.model, self.data = self._physics.model.ptr, self._physics.data.ptr
        if timestep:
            self.model.opt.timestep = timestep
        self.cloth.set_vertices(self.cloth.flat())
        self.run(SETTLING)

    def run(self, seconds: float) -> None:
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))

    def x(self) -> float:
        return self.cloth.vertices()[:, 0].mean()

    def forces(self) -> np.ndarray:
        """Sums of the normal and the tangential forces of MuJoCo's contacts, over the weight."""
        total, force = np.zeros(2), np.zeros(6)
        for i in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, i, force)
            total += force[0], np.hypot(force[1], force[2])
        return total / (self.model.body_mass.sum() * GRAVITY)


def slope(mode: str, tangent: float, timestep: float | None) -> tuple[float, float, float]:
    """Way [m] and speed [m/s] after 5 s, and Coulomb's way [m]."""
    flat = FlatCloth(mode, timestep)
    angle = np.arctan(tangent)
    flat.model.opt.gravity[:] = [GRAVITY * np.sin(angle), 0.0, -GRAVITY * np.cos(angle)]
    start = flat.x()
    flat.run(SLIDING)
    pull = GRAVITY * (np.sin(angle) - FRICTION * np.cos(angle))
    return flat.x() - start, flat.cloth.velocities()[:, 0].mean(), max(pull, 0) / 2 * SLIDING**2


def stop(mode: str, speed: float, timestep: float | None) -> float:
    """Way until the cloth stops, over Coulomb's."""
    flat = FlatCloth(mode, timestep)
    start = flat.x()
    velocities = flat.cloth.velocities()
    velocities[:, 0] += speed
    flat.data.qvel[: velocities.size] = velocities.ravel()
    flat.run(STOPPING)
    return (flat.x() - start) / (speed**2 / (2 * FRICTION * GRAVITY))


def drag(mode: str, speed: float, timestep: float | None) -> tuple[float, float, float]:
    """Friction and normal force over the weight, strain."""
    flat = FlatCloth(mode, timestep)
    cloth, dt = flat.cloth, flat.model.opt.timestep
    rows, columns = cloth.shape
    held = [cloth.index(rows - 1, column) for column in range(columns)]
    targets = np.array([cloth.vertex(i) for i in held])
    for i in held:
        cloth.hold(i)
    forces = []
    lift = round(LIFT_STEPS * 0.01 / dt)
    for step in range(lift + round(DRAG_STEPS * 0.01 / dt)):
        targets += [0.0, 0.0, LIFT / lift] if step < lift else [0.0, -speed * dt, 0.0]
        for i, target in zip(held, targets, strict=True):
            cloth.drive(i, target, dt)
        mujoco.mj_step(flat.model, flat.data)
        forces.append(flat.forces())
    normal, friction = np.mean(forces[-COUNTED:], axis=0)
    return friction, normal, np.percentile(cloth.edge_strain(), 99)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES)
    parser.add_argument("--timestep", type=float, help="[s], in place of the cloth's")
    arguments = parser.parse_args()
    for mode in arguments.modes:
        for tangent in SLOPES:
            way, speed, coulomb = slope(mode, tangent, arguments.timestep)
            print(f"{mode:7} slope {tangent:5.2f}: {way:7.4f} m (Coulomb {coulomb:.3g}), "
                  f"{speed:.4f} m/s", flush=True)  # fmt: skip
        for speed in SPEEDS:
            print(f"{mode:7} stop  {speed:5.2f}: {stop(mode, speed, arguments.timestep):.2f}")
        for speed in DRAGS:
            friction, normal, strain = drag(mode, speed, arguments.timestep)
            print(f"{mode:7} drag  {speed:5.2f}: friction {friction:.2f}, normal {normal:.2f}, "
                  f"strain {strain:.3f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
