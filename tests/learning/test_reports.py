"""Reports of a training where there is no terminal."""

import json
import re
import time

from softgym_mj.learning import reports
from softgym_mj.learning.methods.sac import SAC
from tests.command import invoked, output_of

SETTINGS = {
    "env_steps": 16, "num_envs": 2, "part": 8, "evaluate_every": 2, "episodes": 1,
    "final_episodes": 2, "fidelity": "fast", "episode_steps": 6, "random_steps": 8, "updates": 2,
    "batch": 8, "hidden": [8], "replay": 24,
}  # fmt: skip


def test_a_log_has_lines_of_how_a_training_goes(tmp_path, monkeypatch):
    monkeypatch.setattr(reports, "LINE_SECONDS", 0.01)
    command = ["train", "sac", "straighten_rope", "--device", "host", "--out", str(tmp_path)]
    command += ["--settings", json.dumps(SETTINGS)]
    update = SAC.update

    def interrupted(sac, batch):  # The first update is in the second part.
        time.sleep(0.05)
        raise KeyboardInterrupt

    monkeypatch.setattr(SAC, "update", interrupted)
    done = invoked(*command)
    assert done.exit_code != 0
    lines = done.output.splitlines()
    name = r"\d\d:\d\d:\d\d sac straighten_rope, seeds 0: "
    assert lines[0].endswith(" sac straighten_rope: creating 2 environments")
    assert any(re.fullmatch(f"{name}starts in {tmp_path}", s) for s in lines)
    assert any(re.match(f"{name}learns: 8 of 16 env steps, .*/s, .* min left", s) for s in lines)
    monkeypatch.setattr(SAC, "update", update)
    lines = output_of(*command).splitlines()
    assert any(re.fullmatch(f"{name}continues from 8 env steps in {tmp_path}", s) for s in lines)
    assert any(re.match(f"{name}evaluates: 16 of 16 env steps, \\d+/s, ", s) for s in lines)
    assert any(re.match(f"{name}ended: 16 of 16 env steps, .*, held out", s) for s in lines)
    assert not any("16 of 16" in s and "min left" in s for s in lines)


def test_a_function_is_called_by_the_clock_and_at_the_end():
    times = []
    with reports.repeated(lambda: times.append(time.monotonic()), 0.02):
        time.sleep(0.3)  # As long as a vector step.
    number = len(times)
    assert number >= 4
    time.sleep(0.05)
    assert len(times) == number
