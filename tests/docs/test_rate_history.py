"""The history of measured rates against two commits written by hand."""

import json
import subprocess

from tools import rate_history


def test_rates_of_two_commits(tmp_path, monkeypatch):
    def git(*arguments):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments], check=True)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(rate_history, "ROOT", tmp_path)
    monkeypatch.setattr(rate_history, "FILE", tmp_path / "rates.csv")
    git("init", "-q")
    (tmp_path / "docs").mkdir()
    on_core, on_gpu = tmp_path / "docs" / "throughput.json", tmp_path / "docs" / "gpu.json"
    machine = {"processor": "A", "humanoid_mj_steps_per_second": 51104.2}
    for rate in (10.4, 20.6):
        rope = {"straighten_rope": {"env_steps_per_second": rate}}
        on_core.write_text(json.dumps({"machine": machine, "tasks": rope}))
        git("add", ".")
        git("commit", "-qm", "Measure")
    rates = {"fold_cloth": {"16": {"env_steps_per_s": 476.3}}}
    on_gpu.write_text(json.dumps({"machine": {"gpu": "B"}, "rates": rates}))
    git("add", ".")
    git("commit", "-qm", "Measure")
    rate_history.main()
    lines = [line.split(",") for line in (tmp_path / "rates.csv").read_text().splitlines()]
    assert lines[0] == list(rate_history.COLUMNS)
    assert [line[2:] for line in lines[1:]] == [
        ["A", "51104", "straighten_rope", "1", "21"],
        ["A", "51104", "straighten_rope", "1", "10"],
        ["B", "", "fold_cloth", "16", "476"],
    ]
    assert len({line[1] for line in lines[1:]}) == 3
