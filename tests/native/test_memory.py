"""Tests of the plugins' memory: behavior when it runs out, and its size."""

import os
import shutil
import subprocess
import sys

import pytest

_LITTLE_MEMORY = """
import mujoco, resource
from tests.scenes.fluid_cup import SPACING, FluidCup
cup = FluidCup((50, 50), 20, height=2.0, substeps=1)
cup.step()
cup.positions[:] = [0, 0, SPACING]
before = cup.positions.copy()
with open("/proc/self/statm") as file:
    used = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, 2 * (used + 100 * 2**20,))
cup.step(2)
assert cup.data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number == 2
assert (cup.positions == before).all()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of memory")
def test_water_stands_still_where_memory_runs_out():
    """Its lists would take 200 MB."""
    subprocess.run([sys.executable, "-c", _LITTLE_MEMORY], check=True, timeout=120)


_CLOTH_IN_ONE_PLACE = """
import mujoco, numpy as np, resource
from tests.native.test_plugin_mishaps import CLOTH, SHEET
from softgym_mj.native.library import load_plugin
load_plugin()
sheet = SHEET.format("a", "0 0 1", "0 0 0").replace("9 9 1", "40 40 1")
model = mujoco.MjModel.from_xml_string(
    f"<mujoco><option timestep='.01'/><extension>{CLOTH}</extension>"
    f"<worldbody>{sheet}</worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
place = data.flexvert_xpos.ravel() * 1e-6
data.qpos[:] += place - data.flexvert_xpos.ravel()
with open("/proc/self/statm") as file:
    used = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, 2 * (used + 600 * 2**20,))
mujoco.mj_step(model, data)
warnings = data.warning
assert warnings[mujoco.mjtWarning.mjWARN_CONTACTFULL].number == 1
assert warnings[mujoco.mjtWarning.mjWARN_BADQPOS].number == 0
assert np.isfinite(data.qpos).all()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of memory")
def test_cloth_in_one_place_takes_little_memory():
    """All pairs of its edges would be ten million, of 60 bytes each, and as many rows."""
    subprocess.run([sys.executable, "-c", _CLOTH_IN_ONE_PLACE], check=True, timeout=120)


_FAILING_NEW = """
#include <dlfcn.h>
#include <cstdlib>
#include <cstring>
#include <new>
extern "C" { int countdown = 0; }  // Allocations by the plugins until one fails, if it is above 0.
static void* Allocate(size_t size, size_t alignment, void* caller) {
  Dl_info info;
  const bool counts = countdown > 0 && dladdr(caller, &info);
  if (counts && strstr(info.dli_fname, "softgym_mj_") && --countdown == 0) throw std::bad_alloc();
  return aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}
void* operator new(size_t size) { return Allocate(size, 16, __builtin_return_address(0)); }
void* operator new[](size_t size) { return Allocate(size, 16, __builtin_return_address(0)); }
void* operator new(size_t size, std::align_val_t alignment) {
  return Allocate(size, size_t(alignment), __builtin_return_address(0));
}
"""
_ANY_FAILS = """
import ctypes, sys, threading
import mujoco
from tests.native.test_plugin_mishaps import wet_sheets
countdown = ctypes.c_int.in_dll(ctypes.CDLL(sys.argv[1]), "countdown")
mujoco.set_mju_user_warning(lambda message: None)
model = wet_sheets("3 3 1")
scene = mujoco.MjvScene(model, maxgeom=10_000)
failed = []

def play():
    try:
        data = mujoco.MjData(model)
        mujoco.mj_step1(model, data)
        other = mujoco.MjData(model)
        mujoco.mj_copyData(other, model, data)
        mujoco.mj_step2(model, other)
        mujoco.mjv_updateScene(
            model, other, mujoco.MjvOption(), None, mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL, scene,
        )
    except mujoco.FatalError as error:
        failed.append(str(error))

n = 0
while countdown.value == 0:  # Until none fails.
    n += 1
    countdown.value = n
    thread = threading.Thread(target=play)  # Each has memory of its own.
    thread.start()
    thread.join()
assert n > 200 and 50 < len(failed) < n, (n, len(failed))
assert all("there is not enough memory" in message for message in failed)
"""


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("g++"), reason="needs a compiler and Linux")
def test_any_allocation_may_fail(tmp_path):
    """Whatever a plugin does then, no exception leaves it: that would end the process."""
    library = tmp_path / "failing_new.so"
    (tmp_path / "new.cc").write_text(_FAILING_NEW)
    build = ["g++", "-std=c++17", "-shared", "-fPIC", "-o", library, tmp_path / "new.cc", "-ldl"]
    subprocess.run(build, check=True)
    command = [sys.executable, "-c", _ANY_FAILS, str(library)]
    environment = os.environ | {"LD_PRELOAD": str(library)}
    subprocess.run(command, check=True, timeout=120, env=environment)
