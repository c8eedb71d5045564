"""Commands for GPUs, of which none is needed here."""

import io
import logging
import types

import pytest
import torch

from softgym_mj.batch import gpu
from softgym_mj.cli import commands
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from tests.command import error_of, invoked, output_of


@pytest.mark.parametrize("device", ["cpu", "host"])
def test_bench_counts_env_steps(device):
    arguments = ["bench", "straighten_rope", "--num-envs", "2", "--device", device]
    words = output_of(*arguments, "--seconds", "0.1").split()
    rate = int(words[words.index("env") - 1])
    assert 10 < rate < 1e6


@pytest.mark.parametrize(
    "kernels",
    [
        ("measures",),
        pytest.param(("fluid", "measures"), marks=pytest.mark.long),
        pytest.param(tuple(gpu.KERNELS), marks=pytest.mark.slow),
    ],
)
def test_kernels_are_compiled_once(tmp_path, monkeypatch, kernels):
    pytest.importorskip("cuda.core")
    monkeypatch.setattr(gpu, "KERNELS", {name: gpu.KERNELS[name] for name in kernels})
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path))
    done = invoked("compile", "--arch", "90")
    lines = done.stdout.splitlines()  # Its log, if a command has set one up, is on stderr.
    assert done.exit_code == 0
    assert sorted(gpu.KERNELS) == [line.split()[0] for line in sorted(lines)]
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "kernels").iterdir()}
    assert len(kept) == len(gpu.KERNELS)
    output_of("compile", "--arch", "90")
    assert kept == {file: file.stat().st_mtime_ns for file in (tmp_path / "kernels").iterdir()}


def test_a_cache_that_cannot_be_written_is_a_warning(tmp_path, monkeypatch):
    core = types.SimpleNamespace(
        ProgramOptions=lambda **_: None,
        Program=lambda *_: types.SimpleNamespace(
            compile=lambda kind: types.SimpleNamespace(code=b"binary")
        ),
    )
    monkeypatch.setattr(gpu, "_core", lambda: core)
    monkeypatch.setattr(gpu, "_architectures", lambda: ("90",))
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path))
    (tmp_path / "kernels").touch()
    with pytest.warns(UserWarning, match=r"cannot be written: .*\. Set SOFTGYM_MJ_CACHE"):
        assert gpu.compiled("measures", "90") == b"binary"
    (tmp_path / "kernels").unlink()
    assert gpu.compiled("measures", "90") == gpu.compiled("measures", "90") == b"binary"
    assert len([*(tmp_path / "kernels").iterdir()]) == 1


def test_what_there_is_no_gpu_for():
    error = error_of("compile", "--arch", "ninety")
    assert isinstance(error, InvalidArgumentError | UnavailableError)
    if not torch.cuda.is_available():
        with pytest.raises(UnavailableError, match=r"no CUDA device.*'cpu' and 'host'"):
            gpu.CudaDevice()
        assert isinstance(error_of("compile"), UnavailableError)


def test_a_line_of_the_log_is_printed_once(monkeypatch, capsys):
    others = logging.StreamHandler(io.StringIO())  # As absl, which dm_control imports, adds one.
    monkeypatch.setattr(logging.root, "handlers", [*logging.root.handlers, others])
    log = logging.getLogger("softgym_mj.batch.gpu")
    monkeypatch.setattr(commands, "app", lambda: log.info("Compiling"))
    commands.main()
    assert capsys.readouterr().err.count("Compiling") == 1
    assert others.stream.getvalue() == ""
