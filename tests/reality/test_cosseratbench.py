"""`RodSolver` in the benchmark cosseratbench: its entry point, experiments, and what it refuses."""

import dataclasses
import importlib
import pathlib
import sys
import tomllib

import pytest

from softgym_mj.exceptions import SimulationError, UnavailableError
from softgym_mj.reality.rope.cosseratbench import RodSolver
from softgym_mj.reality.rope.rods import RodScene

PROJECT = tomllib.loads((pathlib.Path(__file__).parents[2] / "pyproject.toml").read_text())


def benchmark(module: str):
    """Returns a module of the benchmark; skips the test without it."""
    return pytest.importorskip(f"cosseratbench.{module}", reason="needs the extra cosserat")


def experiment(name: str):
    """Returns an experiment of the benchmark."""
    return getattr(benchmark(f"experiments.{name}"), name)


def result(name: str, n_elements: int | None = None, **values):
    """Returns the benchmark's result of an experiment."""
    run = benchmark("experiment").run
    return run(experiment(name), RodSolver(), values=values, n_elements=n_elements)


def test_the_entry_point_names_the_solver():
    point = PROJECT["project"]["entry-points"]["cosseratbench.solvers"][RodSolver.name]
    module, name = point.split(":")
    assert getattr(importlib.import_module(module), name) is RodSolver


def test_a_missing_benchmark_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "cosseratbench.solver", None)
    with pytest.raises(UnavailableError, match="cosserat"):
        _ = RodSolver().capabilities


def test_it_is_a_solver_of_everything_except_for_shear():
    protocol = benchmark("solver")
    assert isinstance(RodSolver(), protocol.Solver)
    assert set(protocol.Capability) - RodSolver().capabilities == {protocol.Capability.SHEAR}


def test_a_cantilever_and_a_cable_have_the_shapes_of_theory():
    cantilever, cable = result("cantilever"), result("catenary", n_elements=20)
    assert cantilever.metrics["tip_deflection_error"] < 0.01
    assert cable.metrics["sag_error"] < 0.01
    assert cable.metrics["settling_residual"] < 1e-6


def test_friction_holds_a_rope_over_a_cylinder_up_to_the_capstan_equation():
    assert result("capstan", overhang=0.8).metrics["slide"] < 1e-3
    assert result("capstan", overhang=1.5).metrics["slide"] > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("tension", [1.0, 10.0, 30.0])
def test_rods_buckle_within_two_percent_of_the_twist_of_greenhill(tension):
    found = result("twist", tension=tension)
    assert found.metrics["critical_twist_error"] < 0.02
    assert found.observations["max_rod_overlap"] < 0.1


def test_what_is_beyond_the_model_is_unsupported():
    scenario = experiment("twist").scenario
    rod = scenario.rods[0]
    motion = rod.end_motion
    across = tuple((0.0, 0.01 * time, 0.0) for time in motion.times)
    for changed, what in (
        (dataclasses.replace(rod, end_motion=dataclasses.replace(motion, displacement=across)),
         "displaced"),
        (dataclasses.replace(rod, material=dataclasses.replace(rod.material, youngs_modulus=1e13)),
         "stretch beyond"),
    ):  # fmt: skip
        with pytest.raises(NotImplementedError, match=what):
            RodSolver().run(
                dataclasses.replace(scenario, rods=(changed,)), n_elements=9, n_frames=2
            )


def test_a_divergence_is_reported_with_its_time(monkeypatch):
    def frames(scene, number, steps):
        yield from [None] * min(number, 4)
        if number > 4:
            raise SimulationError("diverged")

    benchmark("solver")
    monkeypatch.setattr(RodScene, "frames", frames)
    with pytest.raises(benchmark("solver").Diverged) as error:
        RodSolver().run(experiment("cantilever").scenario, n_elements=4, n_frames=11)
    assert error.value.time == pytest.approx(4.0)
