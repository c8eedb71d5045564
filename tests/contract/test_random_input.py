"""Any input works, or ends in a typed error or a usage message."""

import contextlib
import functools
import hashlib
import os
import pathlib
import random
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from hypothesis.internal.conjecture import providers

import softgym_mj
from softgym_mj.robots.factory import CUP_ACTORS, GRIPPERS
from tests.contract.subject import Subject

# Hypothesis also draws constants from the source of all imported modules that are no installed
# packages, so that examples would depend on where this folder is and on what else runs.
providers._get_local_constants = providers.Constants

TASKS = list(softgym_mj.TASKS)
QUICK = ["straighten_rope", "transport_water", "spread_cloth"]

# ---------------------------------------------------------------- values

TEXTS = st.one_of(
    st.text(max_size=8),
    st.sampled_from(["", " ", "a" * 5000, "a/b", "../x", "é\x00", "nan", "None", "1", "all"]),
)
NUMBERS = st.one_of(
    st.integers(-2, 3),
    st.sampled_from([10**9, 10**11, -(2**70), 10**400, 1e308, np.int64(3), np.float64("nan")]),
    st.floats(),
)
PLAIN = st.one_of(st.none(), st.booleans(), NUMBERS, TEXTS)
ANYTHING = st.one_of(
    PLAIN,
    st.lists(PLAIN, max_size=3),
    st.lists(PLAIN, max_size=3).map(tuple),
    st.dictionaries(TEXTS, PLAIN, max_size=2),
    st.sampled_from(
        [b"x", object, 1j, {1, 2}, range(3), range(10**11), np.zeros((2, 2)), [[1], []]]
    ),
)
GOOD = {
    "actor": [*GRIPPERS, *CUP_ACTORS, None],
    "observation": ["full", "reduced", ["full", "full_mask"], "proprioception", "rgb"],
    "image_size": [(8, 8), [64, 32], (1, 1)],
    "action_repeat": [1, 4, None],
    "domain": ["nominal", "in_distribution", "out_of_distribution", {"hue": 5.0}, {"hue": (1, 2)}],
    "num_pickers": [1, 2, 3, None],
    "arms": [1, 2, None],
    "grasp": ["attach", "friction", None],
    "visual": ["primitive", None],
    "count_intersections": [True, False],
    "sizes": [(60, 70), (60, 61)],
    "look": ["fast", "paper"],
    "goal_marks": [True, False],
    "split": ["all", "train", [3], (800, 3)],
    "horizon": [1, 3, None],
    "random_state": [0, None],
    "render_mode": ["rgb_array", "depth_array", None],
    "render_size": [(10, 10), [64, 48]],
    "camera": ["task", "overview"],
    "random": [0, None],
    "max_episode_steps": [1, -1, None],
    "disable_env_checker": [True, False, None],
    "num_envs": [1, 2],
    "vectorization_mode": ["vector_entry_point", "sync", None],
    "vector_kwargs": [{}, {"num_workers": 1}, None],
    "wrappers": [(), None],
    "device": ["cpu", "host"],
    "num_workers": [1, None],
    "autoreset_mode": ["NextStep", "SameStep", "Disabled"],
}
STRAY = st.sampled_from(["", "task", "self", "env", "settings", "num_envs", "é", "a" * 5000])


def keywords(task: str, *others: str) -> st.SearchStrategy[dict]:
    """Keyword arguments of a task, of which about half are what they should be."""

    def value(name: str) -> st.SearchStrategy:
        good = GOOD.get(name)
        return st.one_of(st.sampled_from(good), ANYTHING) if good else ANYTHING

    names = [name for name in (*softgym_mj.TASKS[task].arguments, *others) if name != "fidelity"]
    drawn = st.lists(st.sampled_from(names), max_size=3, unique=True).flatmap(
        lambda chosen: st.fixed_dictionaries({name: value(name) for name in chosen})
    )
    # States of other fidelities than this take long to make.
    common = st.one_of(
        st.just({"fidelity": "fast"}), st.builds(lambda v: {"fidelity": v}, ANYTHING)
    )
    stray = st.one_of(st.just({}), st.dictionaries(STRAY, PLAIN, max_size=1))
    return st.builds(
        lambda *parts: functools.reduce(lambda a, b: a | b, parts), stray, common, drawn
    )


NAMES = st.one_of(st.sampled_from(QUICK * 3 + TASKS), ANYTHING)


def of(task: object) -> str:
    """The task whose arguments are drawn: the given one, or a quick one for an invalid name."""
    return task if isinstance(task, str) and task in TASKS else QUICK[0]


LOADED = NAMES.flatmap(
    lambda task: st.tuples(st.just(task), keywords(of(task), "split", "horizon", "random_state"))
)
MADE = st.sampled_from(TASKS).flatmap(
    lambda task: st.tuples(
        st.just(softgym_mj.TASKS[task].gymnasium_id),
        keywords(
            task, "split", "horizon", "render_mode", "render_size", "camera",
            "max_episode_steps", "disable_env_checker",
        ),
    )
)  # fmt: skip
VECTORS = st.sampled_from(TASKS).flatmap(
    lambda task: st.tuples(
        st.just(softgym_mj.TASKS[task].gymnasium_id),
        keywords(
            task, "split", "horizon", "render_mode", "num_envs", "vectorization_mode",
            "vector_kwargs", "wrappers", "device", "num_workers", "autoreset_mode",
        ),
    )
)  # fmt: skip
SUITED = st.sampled_from(TASKS).flatmap(
    lambda task: st.tuples(
        st.just(task),
        st.one_of(st.none(), keywords(task, "split", "horizon", "random")),
        st.one_of(st.none(), keywords(task)),
        st.one_of(st.booleans(), ANYTHING),
    )
)

# ---------------------------------------------------------------- command lines

WORDS = [
    "", " ", "a" * 5000, "é", "-1", "0", "1", "3", "10000000000", "9" * 23, "1.5", "nan", "1e9",
    "None", "[]", "{}", "{", '{"a": 1}', '{"actor": NaN}', '{"observation": 3}', '{"": 1}',
    '{"fidelity": ["fast"]}', '{"split": "all"}', '{"horizon": "3"}', '{"image_size": [1e9, 1]}',
    "train", "evaluate", "picker", "franka", "attach", "reduced", "full,rgb", ",", "800-", "3-1",
    "0-100000000000", "800,800", "file", "/proc/x/y", "/dev/null", "/dev/zero", "fifo",
    "file/below", "nowhere/x", "policies:short", "policies:nan", "policies:raises", "policies:none",
    "policies:word", "policies:number", "policies:nothing", "broken:x", "nomodule:x", ":", "a:",
    ":b", "bad.pt2", "folder.pt2", "none.pt2", "empty.json", "list.json", "nan.json", "results",
    "scripted", "zero", "random", "cem", "straighten_rope", "--", "-", "--help", "x.png", "x.xyz",
    "horizon", "70000", "fast",
]  # fmt: skip
# Options of each command that keep it short, and all that it has.
COMMANDS: dict[str, tuple[dict[str, str], list[str]]] = {
    "rollout": ({"--episodes": "1", "--policy": "zero", "--look": "fast"},
                ["--policy", "--actor", "--grasp", "--split", "--episodes", "--variation", "--seed",
                 "--look", "--video"]),
    "evaluate": ({"--episodes": "1", "--policy": "zero"},
                 ["--policy", "--actor", "--grasp", "--split", "--episodes", "--variations",
                  "--seeds", "--horizon", "--budget", "--iterations", "--replan-every",
                  "--task-settings", "--jobs", "--out"]),
    "plot": ({"--out": "x.png"}, ["--out", "--csv"]),
    "generate": ({"--num": "1", "--start": "3", "--fidelity": "fast"},
                 ["--start", "--num", "--jobs", "--fidelity"]),
    "record": ({"--episodes": "1", "--policy": "zero"},
               ["--policy", "--actor", "--grasp", "--split", "--episodes", "--variations",
                "--observation", "--task-settings", "--seed", "--dataset", "--author"]),
    "view": ({"--browser": "", "--port": "70000"},  # A port that there is not: it would not end.
             ["--policy", "--actor", "--grasp", "--variation", "--host"]),
    "demo": ({"--variation": "-1"}, ["--out", "--size"]),
    # No folder can be made there: nothing is trained or identified.
    "train sac": ({"--out": "file/below"},
                  ["--preset", "--seeds", "--first-seed", "--device", "--learner-device",
                   "--observation", "--settings", "--task-settings", "--jobs", "--log"]),
    "train distill": ({"--out": "file/below", "--device": "host"},
                      ["--teacher", "--preset", "--seeds", "--observation", "--settings"]),
    "learning table": ({"--results": "results"}, ["--csv", "--results"]),
    "learning join": ({"--out": "file/below"}, []),
    "learning submit": ({}, ["--jobs", "--device"]),
    "validate lab": ({"--fabric": "nope"}, ["--experiment", "--out"]),
    "validate rope": ({}, ["--cable", "--split", "--identified", "--out"]),
    "validate water": ({}, ["--experiment", "--cells", "--out"]),
    "identify rope": ({}, ["--cable", "--recordings", "--out"]),
    "identify cloth": ({}, ["--out"]),
    "bench": ({"--seconds": "0", "--num-envs": "1", "--device": "host"},
              ["--num-envs", "--device", "--task-settings"]),
    "compile": ({"--arch": "x"}, ["--arch"]),
    "photo": ({"--size": "8", "--samples": "1", "--policy": "zero", "--out": "x.png"},
              ["--actor", "--grasp", "--variation", "--step", "--policy", "--camera", "--size",
               "--every", "--out"]),
    "list": ({}, []),
    "": ({}, []),
    "nope": ({}, []),
}  # fmt: skip
POLICIES = """
import numpy as np

number = 3

def short(env):
    return lambda timestep: np.zeros(3)

def nan(env):
    return lambda timestep: np.full(env.action_spec().shape, np.nan)

def word(env):
    return lambda timestep: "up"

def none(env):
    return None

def raises(env):
    def act(timestep):
        raise KeyError("of the policy's own")
    return act
"""

FILES = {
    "file": "x", "empty.json": "", "list.json": "[1, 2]", "nan.json": '{"a": NaN}',
    "bad.pt2": "PK\x03\x04", "policies.py": POLICIES, "broken.py": "1/0",
    "results/result.json": '{"task": "x"}',
}  # fmt: skip


def command_line(command: str) -> st.SearchStrategy[list[str]]:
    """A command, mostly with a task, and up to three options of any value."""
    usual, options = COMMANDS[command]
    words = st.sampled_from(WORDS)
    task = st.one_of(st.just("straighten_rope"), st.sampled_from(["transport_water", *WORDS]))
    many = command.startswith(("plot", "learning", "validate", "identify"))
    first = st.lists(words, max_size=2) if many else st.lists(task, min_size=1, max_size=1)
    chosen = st.dictionaries(st.sampled_from(options or ["--help"]), words, max_size=3)

    def joined(arguments: list[str], given: dict[str, str]) -> list[str]:
        options = [part for pair in (usual | given).items() for part in pair if part]
        alone = command in ("demo", "list", "compile", "validate lab")
        return [*command.split(" "), *([] if alone else arguments), *options]

    return st.builds(joined, first, chosen)


LINES = st.sampled_from(list(COMMANDS)).flatmap(command_line)

# ---------------------------------------------------------------- tests

DOORS = {
    "load": (LOADED, 17),
    "make": (MADE, 12),
    "make_vec": (VECTORS, 5),
    "suite": (SUITED, 12),
    "command": (LINES, 20),
}
CASES = [
    pytest.param(door, factor * number, id=f"{door}-{factor * number}", marks=marks)
    for door, (_, number) in DOORS.items()
    for factor, marks in ((1, ()), (9, pytest.mark.long), (180, pytest.mark.slow))
]


def try_each(door, number, chosen_seed, function) -> None:
    """Calls a function with as many drawn arguments of a door."""
    quiet = [HealthCheck.too_slow, HealthCheck.data_too_large]

    @seed(chosen_seed)
    @settings(max_examples=number, deadline=None, database=None, suppress_health_check=quiet)
    @given(DOORS[door][0])
    def run(arguments):
        function(arguments)

    run()


@pytest.fixture(name="subject", scope="module")
def _subject(tmp_path_factory):
    """What takes the input, in a folder with files that are not what they should be."""
    folder = tmp_path_factory.mktemp("input")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "folder.pt2").mkdir()
    os.mkfifo(folder / "fifo")
    with contextlib.closing(Subject(folder)) as subject:
        yield subject


@pytest.fixture(name="chosen_seed", scope="session")
def _chosen_seed(pytestconfig):
    """0, or that of `pytest --hypothesis-seed=N`; "random" for any."""
    given_seed = pytestconfig.getoption("--hypothesis-seed") or 0
    return random.randrange(2**32) if given_seed == "random" else int(given_seed)


def check(subject, door, arguments, note="") -> None:
    outcome = subject(door, arguments)
    assert outcome.kind != "leaked", f"{note} {door} {arguments!r}\n{outcome.text}"


@pytest.mark.parametrize(("door", "number"), CASES)
def test_what_comes_in_ends_well(subject, door, number, chosen_seed):
    note = f"--hypothesis-seed={chosen_seed}"
    try_each(door, number, chosen_seed, lambda arguments: check(subject, door, arguments, note))


# What once was drawn and did not end well.
FOUND = [
    ("make", ("softgym_mj/PourWater-v0", {"fidelity": "fast", "render_mode": False})),
    ("make", ("softgym_mj/DropCloth-v0", {"fidelity": "fast", "self": None})),
    ("make_vec", ("softgym_mj/DropCloth-v0", {"fidelity": "fast", "self": None})),
]


@pytest.mark.parametrize(("door", "arguments"), FOUND)
def test_what_was_found_ends_well(subject, door, arguments):
    check(subject, door, arguments)


PROGRAM = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
from tests.contract.test_random_input import DOORS, digest
print(*(digest(door) for door in DOORS))
"""


def digest(door: str) -> str:
    """Of the first arguments that are drawn for a door."""
    drawn = []
    try_each(door, 8, 0, lambda arguments: drawn.append(repr(arguments)))
    return hashlib.sha256("\n".join(drawn).encode()).hexdigest()


@pytest.mark.long
def test_draws_depend_on_the_seed_alone(tmp_path):
    """In a process that has imported less than this one, and other constants."""
    (tmp_path / "tests").symlink_to(pathlib.Path(__file__).parents[1])
    (tmp_path / "constants.py").write_text("NAMES = ['kept', 'of here'], [700, 12345, 2.25, b'z']")
    (tmp_path / "draw.py").write_text(PROGRAM)
    process = subprocess.run(
        [sys.executable, "draw.py", "constants"],
        cwd=tmp_path,
        capture_output=True,
        check=False,
        text=True,
    )
    assert process.stdout.split() == [digest(door) for door in DOORS], process.stderr
