"""Folds and drops a cloth at several speeds: strain, held error, rest, layer intersections.

python benchmarks/cloth_fold.py --dims 96 58
"""

import argparse
import math
import time

from softgym_mj.baselines.manipulation_scene import ManipulationScene, fold, lift_and_release
from softgym_mj.entities.cloth import FIDELITIES, SELF_CONTACTS, Cloth

# [m/s]: a calm fold, one axis of a picker at full speed, all three axes at full speed.
SPEEDS = (0.6, 1.0, math.sqrt(3.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dims", type=int, nargs=2, default=(96, 58), help="size in particles")
    parser.add_argument("--fidelity", choices=FIDELITIES, default="default")
    parser.add_argument("--self-contact", choices=SELF_CONTACTS, default="mujoco")
    arguments = parser.parse_args()
    for motion in (fold, lift_and_release):
        for speed in SPEEDS:
            start = time.process_time()
            cloth = Cloth(tuple(arguments.dims), arguments.fidelity, arguments.self_contact)
            scene = ManipulationScene(cloth)
            motion(scene, speed=speed)
            record = scene.record
            print(
                f"{motion.__name__:16} {speed:4.2f} m/s"
                f"  held error {1e3 * record.held_error:5.2f} mm"
                f"  p99 strain {100 * record.strain_99:4.1f} %"
                f"  lowest {1e3 * record.lowest:5.1f} mm"
                f"  rest after {record.settle_time():4.2f} s  intersections: most "
                f"{record.most_intersections}, end {record.end_intersections}"
                f"  warnings {record.warnings}  ({time.process_time() - start:.1f} s CPU)",
                flush=True,
            )


if __name__ == "__main__":
    main()
