"""Environments with images in two threads: a typed error, and no tracebacks at collection."""

import subprocess
import sys

import pytest

CODE = """
import gc, sys, threading
import softgym_mj

def in_thread(function):
    thread = threading.Thread(target=function)
    thread.start()
    thread.join()

def make():
    made.append(softgym_mj.load("straighten_rope", observation="rgb", image_size=(32, 32)))
    made[-1].reset(3)

def use(env):
    try:
        env.reset(4)
    except softgym_mj.exceptions.UnavailableError as error:
        print("in another thread" in str(error))

made = []
make()
in_thread(make)
in_thread(lambda: use(made[0]))
use(made[1])
if sys.argv[1] == "close":
    in_thread(made[0].close)
    made[1].close()
made.clear()
gc.collect()
make()
print(made[0].observation()["rgb"].std() > 1)
"""


@pytest.mark.parametrize("end", ["collect", pytest.param("close", marks=pytest.mark.long)])
def test_who_used_an_environment_elsewhere_gets_an_error_and_no_tracebacks(end):
    command = [sys.executable, "-W", "ignore", "-c", CODE, end]
    process = subprocess.run(command, capture_output=True, check=False, text=True)
    assert (process.stdout.split(), process.stderr) == (["True"] * 3, "")
