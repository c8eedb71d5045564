"""The pictures of docs/gallery: SoftGym's tasks with every kind of actor.

`python -m tools.gallery` (`make gallery`) writes them; some minutes without a GPU. Names of tasks:
only theirs.
"""

import pathlib
import sys
from collections.abc import Sequence

from PIL import Image

from softgym_mj import registry
from softgym_mj.envs.load import load
from softgym_mj.policies.episodes import play
from softgym_mj.robots.arm.models import ARMS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "gallery"
SIZE = 480  # Side [pixels].
QUALITY = 85  # JPEG quality, 0..100.
ACTORS = ("abstract", *ARMS)  # The first: pickers, or a cup that moves by itself.
# Part of the expert's steps until it rests after which it is shown, where most is to be seen.
MOMENT = 0.5
MOMENTS = {"drop_cloth": 0.4, "straighten_rope": 0.6, "pour_water": 0.65, "pour_water_amount": 0.5}


def moment(task: str, actor: str) -> tuple[dict[str, str], int]:
    """The settings of a picture, and the env step that it shows."""
    settings = {} if actor == ACTORS[0] else {"actor": actor}
    env = load(task, split="all", **settings)
    episode = play(env, "scripted", env.task.example_variation, camera=None)
    progress = episode.info["performance"]
    settled = abs(progress - progress[-1]) > 0.01 * abs(progress[-1] - progress[0])
    steps = settled.nonzero()[0].max(initial=0) + 1
    return settings, round(MOMENTS.get(task, MOMENT) * steps)


def main(names: Sequence[str]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or registry.task_names(registry.DOMAIN):
        for actor in ACTORS:
            settings, step = moment(name, actor)
            env = load(name, split="all", look="paper", **settings)
            variation = env.task.example_variation
            picture = play(env, "scripted", variation, size=SIZE, pictures=[step]).frames[0]
            file = FOLDER / f"{name}-{actor}.jpg"
            Image.fromarray(picture).save(file, quality=QUALITY)
            print(f"{file.name}: step {step}, {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
