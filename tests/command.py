"""Commands of `softgym-mj`, run in this process."""

import pytest
from typer.testing import CliRunner, Result

from softgym_mj.cli import commands


def invoked(*words: object) -> Result:
    """Runs a command; returns its exit status, what it prints and what it raises."""
    return CliRunner().invoke(commands.app, [*map(str, words)])


def output_of(*words: object) -> str:
    """Runs a command that succeeds; returns what it prints."""
    done = invoked(*words)
    assert done.exit_code == 0, f"{done.output} {done.exception}"
    return done.output


def error_of(*words: object) -> BaseException | None:
    """Runs a command that fails; returns what it raises."""
    return invoked(*words).exception


def status_of(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Runs a command as the shell would; returns its exit status."""
    monkeypatch.setattr("sys.argv", ["softgym-mj", *words])
    with pytest.raises(SystemExit) as ended:
        commands.main()
    return ended.value.code
