"""Models and states that make no sense, for the engine plugins: no process may end by one.

`python -m tests.native.fuzz_plugins --first N --cases M` plays M cases, from case N on, in
processes of 250 cases each. A case is made from its number alone, and ends well if it returns or
raises a Python exception with a message. `--show N` prints a model. With `--sanitize` a build of
the library is used that finds bad reads, writes, casts and overflows.
"""

import argparse
import contextlib
import copy
import faulthandler
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

import mujoco
import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.native import library
from tests.native.fuzz_models import make_model

ROOT = pathlib.Path(__file__).parents[2]
PER_PROCESS = 250
SECONDS, SANITIZED_SECONDS = 60, 600  # Time limits of a case; the slowest take 2 s on a free core.
MEMORY = 1 << 30  # [bytes] That cases may take beyond what Python and MuJoCo have.
SANITIZERS = (
    "-g1 -fsanitize=address,undefined,float-cast-overflow "
    "-fno-omit-frame-pointer -fno-sanitize-recover=all"
)
ASAN_OPTIONS = (
    "detect_leaks=0:allocator_may_return_null=1:quarantine_size_mb=16:malloc_context_size=5:"
    "max_allocation_size_mb=1024:hard_rss_limit_mb=2500"
)

# ---------------------------------------------------------------------------- states

STRANGE = (np.nan, np.inf, -np.inf, 0.0, 1e9, 1.1e10, 1e30, -1e-300, 1e308, 1.0, -1.0)


def spoil(array, rng):
    """Overwrites some numbers, or all."""
    if not array.size:
        return
    flat = array.reshape(-1)
    which = rng.random(flat.size) < rng.choice([2 / flat.size, 0.1, 1.0])
    kind = rng.integers(6)
    if kind == 0:
        flat[which] = rng.choice(STRANGE)
    elif kind == 1:
        flat[which] = rng.choice(STRANGE, which.sum())
    elif kind == 2:  # Patterns of bits.
        flat[which] = rng.integers(0, 1 << 63, which.sum(), dtype=np.uint64).view(np.float64)
    elif kind == 3:
        flat[which] = rng.normal(size=which.sum()) * 10 ** rng.uniform(-6, 12)
    elif kind == 4:  # All in one place, or nearly so.
        flat[which] = rng.normal() + rng.choice([0, 1e-8, 1e-4]) * rng.normal(size=which.sum())
    else:
        flat[which] = np.round(rng.normal(size=which.sum()) * 1e4)


def spoil_state(model, data, rng):
    names = ("plugin_state", "qpos", "qvel", "mocap_pos", "mocap_quat", "ctrl", "act")
    names += ("qfrc_applied", "xfrc_applied", "qacc_warmstart")
    weights = np.array([8, 4, 4, 2, 1, 1, 1, 1, 1, 1])
    for name in rng.choice(names, rng.integers(1, 4), p=weights / weights.sum()):
        array = getattr(data, name)
        keep = array.reshape(-1)[0] if array.size else 0
        spoil(array, rng)
        if name == "plugin_state" and array.size and rng.random() < 0.8:
            array[0] = keep if rng.random() < 0.5 else 1  # Counts as known.


def change_model(model, data, rng):
    """Changes that a program may make to a compiled model."""
    kind = rng.integers(6)
    if kind == 0:
        model.opt.timestep = rng.choice([0, -0.01, np.nan, np.inf, 1e-12, 1e-3, 1, 1e9, 1e308])
    elif kind == 1:
        spoil(model.opt.gravity, rng)
        spoil(model.opt.wind, rng)
    elif kind == 2:
        model.opt.integrator = rng.integers(4)
        model.opt.disableflags ^= 1 << int(rng.integers(12))
    elif kind == 3 and model.ngeom:
        g = rng.integers(model.ngeom)
        shapes = [t for t in range(7) if t != mujoco.mjtGeom.mjGEOM_HFIELD]
        if model.geom_type[g] in shapes:  # Others have data that belongs to them.
            model.geom_type[g] = rng.choice(shapes)
        model.geom_contype[g] = rng.integers(2)
        model.geom_conaffinity[g] = rng.integers(2)
    elif kind == 4:
        names = ("geom_size", "geom_pos", "geom_quat", "geom_rbound", "geom_friction", "body_pos")
        spoil(getattr(model, rng.choice(names)), rng)
    else:
        names = ("flex_radius", "flexedge_length0", "body_mass", "dof_M0", "flex_friction")
        names += ("jnt_axis", "flex_vert", "body_quat", "dof_damping")
        spoil(getattr(model, rng.choice(names)), rng)


# ---------------------------------------------------------------------------- a case


def draw(model, data, rng):
    scene = mujoco.MjvScene(model, maxgeom=int(rng.choice([1, 50, 1000, 20000])))
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, scene
    )


def take_over(model, data, rng):
    """Through a copy or a saved state."""
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    if rng.random() < 0.3:
        spoil(state, rng)
    other = mujoco.MjData(model)
    mujoco.mj_setState(model, other, state, kind)
    mujoco.mj_step(model, other)
    mujoco.mj_step1(model, data)
    mujoco.mj_step2(copy.copy(model), copy.copy(data))
    mujoco.mj_copyData(data, model, other)


def read(model, data, rng):
    with contextlib.suppress(KeyError):  # No flex carries the plugin.
        solver.contacts(model, data)
    if model.nflexvert:
        solver.holding_force(model, data, int(rng.integers(model.nflexvert)))


def step(model, data, rng):
    mujoco.mj_step(model, data, int(rng.integers(1, 4)))


def forward(model, data, rng):
    mujoco.mj_forward(model, data)


def reset(model, data, rng):
    mujoco.mj_resetData(model, data)


def two_halves(model, data, rng):
    mujoco.mj_step2(model, data)
    mujoco.mj_step1(model, data)


OPERATIONS = (step, step, step, forward, reset, two_halves, draw, take_over, read)
OPERATIONS += (spoil_state, spoil_state, change_model)


def play(number):
    """What became of a case: the message of an exception, or ""."""
    rng = np.random.default_rng(number)
    try:
        model = mujoco.MjModel.from_xml_string(make_model(rng))
        data = mujoco.MjData(model)
        if rng.random() < 0.7:
            spoil_state(model, data, rng)
        step(model, data, rng)
        for i in rng.integers(len(OPERATIONS), size=rng.integers(2, 8)):
            OPERATIONS[i](model, data, rng)
            if OPERATIONS[i] in (spoil_state, change_model):
                step(model, data, rng)
    except Exception as error:  # Any error is accepted.
        assert str(error), f"{error!r} says nothing"
        return str(error)
    return ""


def play_all(numbers):
    """In this process, whose output says how far it came."""
    faulthandler.enable()
    library.load_plugin()
    mujoco.set_mju_user_warning(lambda message: None)
    sanitized = "asan" in os.environ.get("LD_PRELOAD", "")
    if not sanitized:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY,) * 2)
    for number in numbers:
        faulthandler.dump_traceback_later(SANITIZED_SECONDS if sanitized else SECONDS, exit=True)
        print("case", number, flush=True)
        message = play(number)
        faulthandler.cancel_dump_traceback_later()
        print("end", repr(message.splitlines()[0][:200]) if message else "", flush=True)


# ---------------------------------------------------------------------------- many cases


def build(folder):
    """Makes the library with sanitizers; returns the environment in which it runs."""
    configure = ["cmake", "-S", ROOT / "softgym_mj/native", "-B", folder, "-DSKBUILD=ON"]
    configure += ["-DSKBUILD_STATE=wheel", f"-DPython_EXECUTABLE={sys.executable}"]
    subprocess.run([*configure, f"-DCMAKE_CXX_FLAGS={SANITIZERS}"], check=True)
    subprocess.run(["cmake", "--build", folder, "-j2"], check=True)
    find = ["gcc", "-print-file-name=libasan.so", "-print-file-name=libstdc++.so"]
    found = [subprocess.check_output([find[0], name], text=True).strip() for name in find[1:]]
    options = {"ASAN_OPTIONS": ASAN_OPTIONS, "UBSAN_OPTIONS": "print_stacktrace=1"}
    return os.environ | options | {"LD_PRELOAD": ":".join(found), "FUZZED": str(folder)}


def run(first, cases, environment=None, report=lambda number, message: None):
    """Numbers of the cases at which a process ended, each with what it said."""
    failed, number, end = {}, first, first + cases
    while number < end:
        last = min(end, number + PER_PROCESS)
        command = [sys.executable, "-m", "tests.native.fuzz_plugins", "--here"]
        command += ["--first", str(number), "--cases", str(last - number)]
        with tempfile.TemporaryDirectory() as folder, open(f"{folder}/stderr", "w+") as said:
            paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
            child = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=said,
                text=True,
                cwd=folder,
                env={**(environment or os.environ), "PYTHONPATH": ":".join(paths[::-1])},
            )
            for line in child.stdout:
                kind, _, rest = line.strip().partition(" ")
                if kind == "case":
                    number = int(rest)
                elif kind == "end":
                    report(number, rest)
            if child.wait() == 0:
                number = last
                continue
            said.seek(0)
            failed[number] = f"exit status {child.returncode}\n{said.read()[-6000:]}"
            report(number, failed[number])
        number += 1
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=PER_PROCESS)
    parser.add_argument("--sanitize", metavar="FOLDER", help="of the build, made if need be")
    parser.add_argument("--here", action="store_true", help="in this process")
    parser.add_argument("--show", type=int, metavar="NUMBER", help="prints the model of a case")
    options = parser.parse_args()
    if "FUZZED" in os.environ:
        library._FOLDER = pathlib.Path(os.environ["FUZZED"])
    if options.show is not None:
        print(make_model(np.random.default_rng(options.show)))
    elif options.here:
        play_all(range(options.first, options.first + options.cases))
    else:
        environment = build(pathlib.Path(options.sanitize)) if options.sanitize else None
        failed = run(options.first, options.cases, environment, print)
        print(f"{len(failed)} of {options.cases} cases ended a process: {sorted(failed)}")
        sys.exit(bool(failed))


if __name__ == "__main__":
    main()
