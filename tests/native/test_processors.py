"""The same bits on every processor: seeded episodes under other kernels of BLAS and NumPy."""

import json
import os
import subprocess
import sys

import numpy as np

# Prints a digest of the state, the reward, the observation and the action of each env step.
EPISODES = """
import hashlib, json, sys
import numpy as np
import softgym_mj
from softgym_mj.policies import experts

for task, actor, policy, steps in json.loads(sys.argv[1]):
    settings = {} if "rope" in softgym_mj.TASKS[task].tags else {"fidelity": "fast"}
    env = softgym_mj.load(task, actor=actor, split="evaluate", observation="full", **settings)
    timestep, random = env.reset(803), np.random.default_rng(5)
    expert = experts.make_policy(env) if policy == "expert" else None
    for step in range(steps):
        action = expert(timestep) if expert else random.uniform(-1, 1, env.action_spec().shape)
        timestep = env.step(action)
        data, digest = env.physics.data.ptr, hashlib.sha256()
        for part in (data.qpos, data.qvel, timestep.reward, timestep.observation["full"], action):
            digest.update(np.ascontiguousarray(part).tobytes())
        print(task, actor, step, digest.hexdigest())
"""
PLAYED = [
    ("straighten_rope", "picker", "expert", 20),
    ("spread_cloth", "picker", "expert", 30),
    ("fold_cloth", "franka", "random", 8),
    ("straighten_rope", "sawyer", "expert", 15),
]

# What NumPy has for this processor beyond what it is built for: AVX2, AVX-512 and so on.
FOUND = " ".join(np.show_config(mode="dicts")["SIMD Extensions"]["found"])
# OpenBLAS's kernels for processors with AVX2, and for some with neither that nor fused products,
# whose sums differ the most. Beside these, what this processor is given by default.
OTHERS = [
    {"OPENBLAS_CORETYPE": "Haswell"},
    {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": FOUND},
]


def digests(variables):
    """Of the episodes' env steps, a line each, in a process of its own."""
    result = subprocess.run(
        [sys.executable, "-c", EPISODES, json.dumps(PLAYED)],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return result.stdout.splitlines()


def test_episodes_are_bit_equal_on_other_processors():
    expected = digests({})
    assert len(expected) == sum(steps for *_, steps in PLAYED)
    for variables in OTHERS:
        assert digests(variables) == expected
