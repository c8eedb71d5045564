"""Do the same seed and actions give the same bits, whatever the kernels that a processor runs?

    python -m tests.native.portability

plays an episode of every task and actor, start states included, with its scripted expert or random
actions, and decisions of the planners, in one process after the other: with what NumPy, OpenBLAS
and the plugins choose for this processor, and with what they would choose for others. Prints a
digest of all that was seen in each, and ends with status 1 if any two differ.
"""

import argparse
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Sequence

import numpy as np

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.parallel.executors import SerialExecutor
from softgym_mj.policies import planners
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.model_predictive import ModelPredictivePolicy
from softgym_mj.policies.rollouts import ExecutorRollouts

VARIATION, SEED = 803, 5
LONGEST = 40  # Env steps of an episode, unless it ends before.
PLANNED = 2  # Env steps of one that is planned.
# NumPy's CPU features of this processor beyond its baseline: AVX2, AVX-512 and so on.
FOUND: Sequence[str] = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
WIDE = " ".join(name for name in FOUND if name != "X86_V3")
# Variables by name: OpenBLAS's kernels for processors with AVX2, and for some with neither that nor
# fused products, whose sums differ the most; NumPy's without AVX-512, and without all it has found.
KERNELS = {
    "usual": {},
    "OpenBLAS for Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "NumPy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": WIDE},
    "plugins with AVX2": {"SOFTGYM_MJ_SIMD": "avx2"},
    "none of these": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": " ".join(FOUND),
        "SOFTGYM_MJ_SIMD": "scalar",
    },
}

Case = tuple[str, str, str]  # Task, actor, policy.


def cases() -> list[Case]:
    """An episode of every task and actor, and planned ones."""
    found = [
        (name, actor, "scripted")
        for name, record in softgym_mj.TASKS.items()
        for actor in record.resolve().actors
    ]
    return [*found, *(("straighten_rope", "picker", planner) for planner in planners.PLANNERS)]


def digest(case: Case, longest: int = LONGEST) -> str:
    """SHA-256 of what is seen in an episode: states, actions, rewards, observations, info."""
    task, actor, name = case
    settings = {"actor": actor, "fidelity": "fast", "observation": ["full", "reduced"]}
    env = softgym_mj.load(task, split="all", **settings)
    timestep = env.reset(VARIATION)
    if name in planners.PLANNERS:
        planner = planners.make_planner(name, task, horizon=5, budget=200, iterations=2)
        rollouts = ExecutorRollouts(task, settings, SerialExecutor())
        act, longest = ModelPredictivePolicy(env, planner, rollouts, seed=SEED), PLANNED
    else:
        try:
            act = make_policy(name, env)
        except InvalidArgumentError:  # There is no expert for this actor.
            act = make_policy("random", env, SEED)
    whole = hashlib.sha256()
    while not timestep.last() and env.step_count < longest:
        action = act(timestep)
        timestep = env.step(action)
        data = env.physics.data.ptr
        numbers = [float(value) for value in env.info().values()]
        seen = (data.qpos, data.qvel, data.plugin_state, action, timestep.reward, numbers)
        for part in (*seen, *timestep.observation.values()):
            whole.update(np.ascontiguousarray(part, dtype=float).tobytes())
    return whole.hexdigest()


def digests(variables: dict[str, str], wanted: Sequence[Case], longest: int) -> dict[str, str]:
    """Digests of cases by name, from a separate process with these variables and an empty cache."""
    with tempfile.TemporaryDirectory() as cache:
        path = os.pathsep.join([str(pathlib.Path(__file__).parents[2]), *sys.path])
        process = subprocess.run(
            [sys.executable, __file__, "--play", json.dumps(wanted), "--longest", str(longest)],
            env={**os.environ, "PYTHONPATH": path, "SOFTGYM_MJ_CACHE": cache, **variables},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    return dict(line.rsplit(" ", 1) for line in process.stdout.splitlines())


def main() -> None:
    """Compares all kernels."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--longest", type=int, default=LONGEST, help="env steps of an episode")
    parser.add_argument("--play", type=json.loads, help="print digests of these cases instead")
    arguments = parser.parse_args()
    if arguments.play:
        for case in map(tuple, arguments.play):
            print(", ".join(case), digest(case, arguments.longest), flush=True)
        return
    expected, differ = None, 0
    for name, variables in KERNELS.items():
        found = digests(variables, cases(), arguments.longest)
        expected = expected or found
        others = [case for case in expected if found[case] != expected[case]]
        differ += len(others)
        whole = hashlib.sha256(json.dumps(found).encode()).hexdigest()[:16]
        print(f"{name}: {len(found)} episodes, {whole}; differ: {others or 'none'}", flush=True)
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
