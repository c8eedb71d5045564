"""Joins trainings of different seeds: curve, episodes, card and policies in one folder."""

import pathlib
from collections.abc import Sequence

from softgym_mj.exceptions import StoreError
from softgym_mj.learning.curves import CARD, EPISODES, FILE, POLICY
from softgym_mj.learning.results import read_rows, write_rows
from softgym_mj.storage.files import make_folder, read_json, read_whole, write_json, write_whole

_SAME = "method", "preset", "training", "settings", "evaluations", "backend", "versions"


def join(folders: Sequence[pathlib.Path], out: pathlib.Path) -> list[int]:
    """Writes the joint result of finished trainings that differ only in their seeds.

    Args:
        folders: Folders of the trainings.
        out: Folder of the result; it may contain the trainings.

    Returns:
        All seeds.

    Raises:
        StoreError: for trainings that differ in other settings, share a seed or are unfinished.
    """
    cards = [read_json(folder / CARD) for folder in folders]
    rows = {folder: read_rows(folder / FILE) for folder in folders}
    first, card = folders[0], cards[0]
    of: dict[int, pathlib.Path] = {}
    for folder, own in zip(folders, cards, strict=True):
        for name in _SAME:
            if own.get(name) != card.get(name):
                where = f"{name} in {folder / CARD} and in {first / CARD}"
                raise StoreError(f"cannot join trainings: {where} differ")
        done = [
            row for row in rows[folder] if row.final and row.env_steps == own["evaluations"][-1]
        ]
        if {row.seed for row in done} != {*own["seeds"]}:
            raise StoreError(f"cannot join trainings: {folder} has not ended")
        for seed in own["seeds"]:
            if seed in of:
                raise StoreError(
                    f"cannot join trainings: {of[seed]} and {folder} both have {seed=}"
                )
            of[seed] = folder
    make_folder(out)
    seeds = sorted(of)
    joint = [row for own in rows.values() for row in own]
    write_rows(sorted(joint, key=lambda r: (r.env_steps, r.split != "train", r.seed)), out / FILE)
    _join_episodes(folders, out)
    for seed in seeds:
        name = POLICY.format(seed=seed)
        if (of[seed] / name).exists():
            write_whole(out / name, read_whole(of[seed] / name))
    last = [row for own in cards for row in own["last"]]
    seconds = sum(own["seconds"] for own in cards)
    write_json(out / CARD, {**card, "seconds": seconds, "last": last, "seeds": seeds})
    return seeds


def _join_episodes(folders: Sequence[pathlib.Path], out: pathlib.Path) -> None:
    texts = [read_whole(folder / EPISODES) for folder in folders]
    header = texts[0].split(b"\n", 1)[0]
    bodies = [text.split(b"\n", 1)[1] for text in texts]
    write_whole(out / EPISODES, header + b"\n" + b"".join(bodies))
