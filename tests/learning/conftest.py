"""What tests of trainings share."""

import pytest


@pytest.fixture(name="no_policies")
def _no_policies(monkeypatch):
    """Trainings write empty policy files: exports take most of the time of a short training."""
    from softgym_mj.learning import training

    monkeypatch.setattr(training, "export_policy", lambda *_: b"")
