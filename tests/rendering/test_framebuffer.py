"""The off-screen buffer has the size of the largest image, and no image depends on it."""

import concurrent.futures
import gc
import sys

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import UnavailableError
from softgym_mj.rendering import framebuffer
from softgym_mj.rendering.offscreen import LARGEST_IMAGE, CameraView

SMALL, LARGE = (24, 32), (120, 90)


def size_of(env):
    """(height, width) of MuJoCo's own buffer."""
    context = env.physics.contexts_for(1, 1).mujoco.ptr
    return context.offHeight, context.offWidth


def everything(view, physics):
    """Renders a view."""
    return [view.rgb(physics), view.depth(physics), view.segmentation(physics)]


def same(images, others):
    return all(map(np.array_equal, images, others))


@pytest.fixture(name="env")
def _env():
    env = softgym_mj.load("straighten_rope", observation="rgb", image_size=SMALL)
    env.reset(800)
    yield env
    env.close()


def test_a_context_that_cannot_be_made_is_freed_silently(monkeypatch):
    """As with MUJOCO_GL=glfw and no display."""

    class NoContext:
        is_elsewhere = terminated = False

        def make_current(self):
            raise RuntimeError("no OpenGL")

    unraisable = []
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    with pytest.raises(RuntimeError, match="no OpenGL"):
        framebuffer._MjrContext(None, NoContext())
    gc.collect()
    assert unraisable == []


def test_it_grows(env):
    """To what is asked for, on each side; images stay the same bits at any size of it."""
    assert size_of(env) == SMALL
    small, large = CameraView("task", *SMALL), CameraView("task", *LARGE)
    alone = everything(small, env.physics)
    assert size_of(env) == SMALL
    grown = everything(large, env.physics)
    assert size_of(env) == (LARGE[0], LARGE[1])
    assert same(everything(small, env.physics), alone)
    whole = env.physics.render(480, 640, camera_id="task")  # dm_control's way.
    assert size_of(env) == (LARGEST_IMAGE, LARGEST_IMAGE)
    assert whole.std() > 10.0
    assert same(everything(small, env.physics), alone)
    assert same(everything(large, env.physics), grown)


def test_an_image_repeats_until_something_has_moved(env):
    view, fresh = CameraView("task", *LARGE, still=1e-3), CameraView("task", *LARGE)
    first = view.rgb(env.physics)
    assert np.array_equal(first, fresh.rgb(env.physics))
    for moved, repeats in ((6e-4, True), (6e-4, False), (0.05, False), (1e-6, True)):
        before = view.rgb(env.physics)
        env.physics.data.qpos[:] += moved  # Coordinates of vertices and pickers; motions add up.
        after = view.rgb(env.physics)
        expected = before if repeats else fresh.rgb(env.physics)
        assert np.array_equal(after, expected)
    assert not np.array_equal(after, first)
    view.segmentation(env.physics)  # It uses the same buffer.
    assert np.array_equal(view.rgb(env.physics), after)
    env.physics.model.mat_rgba[:] *= 0.5  # A color changes the image, too.
    assert np.array_equal(view.rgb(env.physics), fresh.rgb(env.physics))
    assert not np.array_equal(view.rgb(env.physics), after)


def test_dm_control_renders_what_it_does_without():
    """Before and after small images, and in an environment that has none."""
    env, other = (softgym_mj.load("straighten_rope", observation=o) for o in ("rgb", "reduced"))
    env.reset(800), other.reset(800)
    expected = other.physics.render(300, 700, camera_id="task")
    assert np.array_equal(env.physics.render(300, 700, camera_id="task"), expected)


def test_it_is_of_its_model():
    """Another variation of other size has a new buffer, no larger than needed."""
    env = softgym_mj.load("spread_cloth", observation="rgb", image_size=SMALL, fidelity="fast")
    for variation in (0, 1):
        env.reset(variation)
        assert size_of(env) == SMALL


def test_another_thread_is_told_why():
    env = SoftGymEnv("straighten_rope", observation="rgb", image_size=SMALL)
    env.reset(seed=0)
    with concurrent.futures.ThreadPoolExecutor(1) as thread:
        future = thread.submit(env.step, np.zeros(8))
        with pytest.raises(UnavailableError, match="in another thread") as error:
            future.result()
        assert "apt-get" not in str(error.value)
        own = SoftGymEnv("straighten_rope", observation="rgb", image_size=SMALL)
        observation, _ = thread.submit(own.reset, seed=0).result()
        assert np.array_equal(observation, env.reset(seed=0)[0])
        thread.submit(own.close).result()


def test_the_context_outlives_a_change_of_the_model():
    env = softgym_mj.load("fold_cloth", observation="rgb", image_size=(32, 32), fidelity="fast")
    env.reset(1)
    context, size = env.physics.contexts.gl, env.physics.model.nv
    other = env.reset(2).observation["rgb"]
    assert env.physics.model.nv != size and env.physics.contexts.gl is context
    fresh = softgym_mj.load("fold_cloth", observation="rgb", image_size=(32, 32), fidelity="fast")
    np.testing.assert_array_equal(fresh.reset(2).observation["rgb"], other)
    env.close()
    assert context._refcount == 0
