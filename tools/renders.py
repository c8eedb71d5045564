"""Path-traced renders of README and docs/pictures.md, docs/renders: one per material.

`python -m tools.renders` (`make renders`) writes them, minutes each; names select some of them.
"""

import dataclasses
import pathlib
import sys
from collections.abc import Mapping, Sequence

import mujoco
from PIL import Image

from softgym_mj.envs.load import load
from softgym_mj.policies.factory import make_policy
from softgym_mj.rendering import photo

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "renders"
SIZE = 512  # Side [pixels].
QUALITY = 92  # JPEG quality without visible blocks.


@dataclasses.dataclass(frozen=True)
class Still:
    """State and camera of a render.

    Attributes:
        task: name of the task.
        step: number of env steps of the expert before the render.
        middle: point that the camera looks at [m].
        azimuth, elevation: view direction [deg].
        distance: distance of the camera from that point [m].
        samples: number of samples per pixel.
        settings: arguments of the task.
    """

    task: str
    step: int
    middle: tuple[float, float, float]
    azimuth: float
    elevation: float
    distance: float
    samples: int = 64
    settings: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def camera(self) -> mujoco.MjvCamera:
        """Free camera of MuJoCo with this view."""
        camera = mujoco.MjvCamera()
        camera.lookat[:], camera.distance = self.middle, self.distance
        camera.azimuth, camera.elevation = self.azimuth, self.elevation
        return camera


STILLS = {
    "cloth": Still("fold_cloth", 20, (0.06, 0.06, 0.10), 72, -30, 0.95),
    "rope": Still("rope_configuration", 17, (0.01, 0.02, 0.02), 62, -40, 0.5),
    "water": Still("pour_water", 58, (0.55, 0.0, 0.22), 80, -20, 1.3, 128),
    "arms": Still("fold_cloth", 40, (0.0, 0.0, 0.22), 172, -26, 1.8, settings={"actor": "franka"}),
}


def main(names: Sequence[str]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or STILLS:
        chosen = STILLS[name]
        env = load(chosen.task, split="all", look="paper", **chosen.settings)
        act = make_policy("scripted", env)
        timestep = env.reset(env.task.example_variation)
        for _ in range(chosen.step):
            timestep = env.step(act(timestep))
        picture = photo.still(env, chosen.camera, SIZE, chosen.samples)
        file = FOLDER / f"{name}.jpg"
        Image.fromarray(picture).save(file, quality=QUALITY, subsampling=0)
        print(f"{file.name}: {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
