"""Start states that are settled together: their oracle is each settled alone by MuJoCo."""

import numpy as np
import pytest

import softgym_mj.tasks.shared.starts.settling
from softgym_mj.batch.device import CpuDevice
from softgym_mj.registry import find
from softgym_mj.tasks.shared.starts.cloths import CrumpledCloth, FlatCloth, HangingCloth
from softgym_mj.tasks.shared.starts.twisted_rope import TwistedRope
from tests.command import output_of
from tests.native.torch_device import TorchDevice

INDICES = [803, 7]


@pytest.mark.parametrize(
    ("start", "device"),
    [
        (TwistedRope(fidelity="fast"), TorchDevice()),
        (FlatCloth(fidelity="fast"), CpuDevice(2, 3)),
        (HangingCloth(fidelity="fast"), CpuDevice(1, 3)),
        (CrumpledCloth(fidelity="fast"), CpuDevice(1, 1)),
        ("water", TorchDevice()),
    ],
    ids=["rope", "flat", "hanging", "crumpled", "water"],
)
def test_together_as_alone(start, device):
    if start == "water":
        start = find("transport_water").build(fidelity="fast").store._start
    together = start.generate_all(INDICES, device)
    for index, found in zip(INDICES, together, strict=True):
        np.testing.assert_array_equal(found, start.generate(index))


def test_what_there_is_no_room_for_is_settled_alone(monkeypatch):
    start = CrumpledCloth(fidelity="fast")
    alone = start.generate(7)
    describe = softgym_mj.tasks.shared.starts.settling.describe
    monkeypatch.setattr(
        softgym_mj.tasks.shared.starts.settling,
        "describe",
        lambda model, grippers: describe(model, grippers, 0.02),
    )
    (together,) = start.generate_all([7], CpuDevice())
    np.testing.assert_array_equal(together, alone)


def test_files_do_not_depend_on_the_device(tmp_path, monkeypatch):
    files = []
    for device in ("cpu", "host"):
        monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / device))
        command = ["generate", "drop_cloth", "--start", "5", "--num", "2", "--fidelity", "fast"]
        assert "generated 2, found 0" in output_of(*command, "--device", device)
        found = sorted((tmp_path / device).rglob("*.value"))
        files.append([(file.name, file.read_bytes()) for file in found])
    assert len(files[0]) == 2
    assert files[0] == files[1]
