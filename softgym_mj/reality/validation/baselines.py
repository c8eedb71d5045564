"""What other simulators reached on the same data sets, as published, and ranks among them.

Rags: means of Chamfer distances over repeats by a third party's notes for "dynamic", best fits to
the first repeat by the authors' notebook for "quasi_static"; masses of the fitted MuJoCo were 2.3
to 11.7 kg instead of 0.05 to 0.10 kg. Garments: means over seven garments of the benchmark's table
of 105 rows; the cells of the T-shirt for itself. Markers: a forecast of 5 s of twisting after 1 s.
"""

import math
from collections.abc import Mapping

RAGS: Mapping[str, Mapping[str, float]] = {
    "cotton/dynamic": {"MuJoCo 3": 0.079, "SOFA": 0.078, "Bullet": 0.155, "Flex": 0.168},
    "chequered/dynamic": {"MuJoCo 3": 0.067, "SOFA": 0.068, "Bullet": 0.119, "Flex": 0.164},
    "linen/dynamic": {"MuJoCo 3": 0.071, "SOFA": 0.061, "Bullet": 0.116, "Flex": 0.160},
    "cotton/quasi_static": {"MuJoCo 3": 0.0698, "SOFA": 0.0807},
    "chequered/quasi_static": {"MuJoCo 3": 0.0534, "SOFA": 0.0693},
    "linen/quasi_static": {"MuJoCo 3": 0.0692, "SOFA": 0.0710},
}  # [m] Chamfer distance, simulated vertices to real points.

GARMENTS: Mapping[str, Mapping[str, float]] = {
    "fling": {"Isaac Sim": 0.0607, "PyBullet": 0.0635, "GarmentDynamics": 0.0414},
    "fold": {"Isaac Sim": 0.0327, "PyBullet": 0.0273, "GarmentDynamics": 0.0196},
    "grasp": {"Isaac Sim": 0.0396, "PyBullet": 0.0386, "GarmentDynamics": 0.0242},
    "green_tshirt/fling": {"Isaac Sim": 0.0567, "PyBullet": 0.0532, "GarmentDynamics": 0.0419},
    "green_tshirt/fold": {"Isaac Sim": 0.0314, "PyBullet": 0.0227, "GarmentDynamics": 0.0132},
    "green_tshirt/grasp": {"Isaac Sim": 0.0341, "PyBullet": 0.0348, "GarmentDynamics": 0.0226},
}  # [m] Real points to simulated vertices, with given end effectors.

MARKERS: Mapping[str, Mapping[str, float]] = {
    "twist": {"persistence": 0.075, "spring mesh, best": 0.119, "spring mesh, worst": 0.209}
}  # [m] Root of the mean square.


def rank(value: float, others: Mapping[str, float]) -> int | None:
    """The place of a distance [m] among others, 1 for the least; None if it is not a number."""
    return None if math.isnan(value) else 1 + sum(other < value for other in others.values())
