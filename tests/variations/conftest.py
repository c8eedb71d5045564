"""An initializer that takes no time, and its store in an empty cache."""

import dataclasses
import pathlib

import numpy as np
import pytest

from softgym_mj.variations import VariationStore, generator


@dataclasses.dataclass(frozen=True)
class FakeInitializer:
    """Cheap random points; every call is noted as a line in the file `log`."""

    log: str
    name: str = "fake"
    scale: float = 1.0

    @property
    def parameters(self) -> dict[str, object]:
        return {"scale": self.scale}

    def points(self, index: int) -> np.ndarray:
        return self.scale * generator(self.name, index).normal(size=(3 + index % 4, 3))

    def generate(self, index: int) -> np.ndarray:
        with open(self.log, "a") as stream:
            stream.write(f"{index}\n")
        return self.points(index)

    def calls(self) -> list[int]:
        """The variations generated so far, in order."""
        log = pathlib.Path(self.log)
        return [int(line) for line in log.read_text().split()] if log.exists() else []


@pytest.fixture(name="initializer")
def _initializer(tmp_path, monkeypatch) -> FakeInitializer:
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "cache"))
    return FakeInitializer(log=str(tmp_path / "log"))


@pytest.fixture(name="store")
def _store(initializer) -> VariationStore:
    return VariationStore(initializer)
