"""Policies of files and modules: what they are given, what their seeds are, what is none."""

import json
import pathlib
import zipfile

import numpy as np
import pytest

import softgym_mj
from softgym_mj.evaluation import Configuration, evaluate
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.policies.exported import NOTE, observes
from softgym_mj.policies.factory import depends_on_seed, make_policy
from softgym_mj.policies.saved import sha256

SHORT = {"horizon": 6}
ROPE = 36  # Numbers of the rope's reduced state.


def constant(env, seed=0):
    """A policy for the tests: every entry is a tenth of the seed."""
    action = np.full(env.task.actor.action_size, seed / 10)
    return lambda timestep: action


def broken(env):
    """No policy: an error of its own."""
    return env.no_such_attribute


def picky(env):
    """No policy: an error of the package."""
    raise InvalidArgumentError("env", env, "another one")


def exported(file, size=ROPE, actions=8, seed=0):
    """Writes a linear policy of observations of `size` entries; returns its weights."""
    import torch

    torch.manual_seed(seed)
    module = torch.nn.Linear(size, actions)
    program = torch.export.export(module, (torch.zeros(1, size),))
    torch.export.save(program, file)
    return module.weight.detach().numpy(), module.bias.detach().numpy()


def acted(weights, observation):
    weight, bias = weights
    return np.clip(weight @ observation + bias, -1.0, 1.0)


@pytest.fixture(name="env", scope="module")
def _env():
    return softgym_mj.load("straighten_rope", split="all", **SHORT)


def test_an_exported_policy_acts_on_the_observation(env, tmp_path):
    file = tmp_path / "policy.pt2"
    timestep = env.reset(800)
    weights = exported(file)
    expected = acted(weights, timestep.observation["reduced"])
    np.testing.assert_allclose(
        make_policy(str(file), env, trust=True)(timestep), expected, atol=1e-5
    )
    configuration = Configuration("straighten_rope", str(file), (800,), (0,), SHORT)
    evaluate(configuration, tmp_path / "run", trust=True)
    exported(file, actions=3)
    with pytest.raises(InvalidArgumentError, match="returns 3 numbers; an action has 8"):
        make_policy(str(file), env, trust=True)(timestep)
    exported(file, size=20)
    message = r"shape \(1, 36\), torch\.float32: it was exported for shape \(1, 20\), .*example"
    with pytest.raises(InvalidArgumentError, match=message):
        make_policy(str(file), env, trust=True)(timestep)
    file.write_bytes(file.read_bytes()[:-500])
    with pytest.raises(InvalidArgumentError):
        make_policy(str(file), env, trust=True)


def test_an_exported_policy_acts_on_images(tmp_path):
    import torch

    class Brightness(torch.nn.Module):
        """Every entry is the mean of the image, from 0 to 1."""

        def forward(self, image):
            return image.double().mean(dim=(1, 2, 3))[:, None].expand(-1, 8) / 255

    file = tmp_path / "policy.pt2"
    example = torch.zeros(1, 24, 32, 3, dtype=torch.uint8)
    torch.export.save(torch.export.export(Brightness(), (example,)), file)
    settings = {"observation": "rgb", "image_size": (24, 32)}
    env = softgym_mj.load("straighten_rope", **settings)
    timestep = env.reset(800)
    action = make_policy(str(file), env, trust=True)(timestep)
    np.testing.assert_allclose(action, timestep.observation["rgb"].mean() / 255, rtol=1e-12)
    both = softgym_mj.load("straighten_rope", observation=["reduced", "rgb"], image_size=(24, 32))
    with pytest.raises(InvalidArgumentError, match=r"takes one observation; .* reduced, rgb"):
        make_policy(str(file), both, trust=True)(both.reset(800))


def test_seeds_choose_files(env, tmp_path):
    weights = [exported(tmp_path / f"run_{seed}.pt2", seed=seed) for seed in range(2)]
    timestep = env.reset(800)
    name = str(tmp_path / "run_{seed}.pt2")
    for seed, own in enumerate(weights):
        action = make_policy(name, env, seed, trust=True)(timestep)
        expected = acted(own, timestep.observation["reduced"])
        np.testing.assert_allclose(action, expected, atol=1e-5)
    with pytest.raises(StoreError, match=r"run_2\.pt2 cannot be read: No such.*Results, Pol"):
        make_policy(name, env, 2)
    assert np.all(make_policy(f"{__name__}:constant", env, 3)(None) == 0.3)  # And functions.


@pytest.mark.parametrize(
    ("name", "depends"),
    [
        ("random", True),
        ("icem", True),
        ("scripted", False),
        ("zero", False),
        ("run_{seed}.pt2", True),
        ("run.pt2", False),
        (f"{__name__}:constant", True),
        (f"{__name__}:broken", False),
        ("builtins:bool", False),
    ],
)
def test_what_depends_on_a_seed(name, depends):
    assert depends_on_seed(name) is depends


def test_the_content_of_a_policy_is_known_by_its_hash(tmp_path):
    file = tmp_path / "policy.pt2"
    file.write_bytes(b"abc")  # SHA-256 of "abc": FIPS 180-2, appendix B.1.
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256(str(file), 0) == {str(file): expected}
    (tmp_path / "run_7.pt2").write_bytes(b"abc")
    assert sha256(str(tmp_path / "run_{seed}.pt2"), 7) == {str(tmp_path / "run_7.pt2"): expected}
    own, name = sha256(f"{__name__}:constant", 0), f"{__name__}:constant"
    file.write_bytes(pathlib.Path(__file__).read_bytes())
    assert own == {name: sha256(str(file), 0)[str(file)]}
    assert sha256("builtins:bool", 0) == {}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("text.pt2", "is not what torch.export.save"),
        ("no_such_module:policy", "cannot be imported: ModuleNotFoundError"),
        ("softgym_mj.evaluation:nothing", "cannot be imported: AttributeError"),
        ("builtins:bool", "not a function of time steps"),
        ("json:dumps", "TypeError: Object of type Environment is not JSON serializable"),
        (f"{__name__}:broken", r"AttributeError: .*no_such_attribute.*test_saved_policies\.py:\d"),
        (f"{__name__}:picky", "^env=.*another one"),
    ],
)
def test_what_is_no_policy(name, message, env, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("text.pt2").write_text("hello")
    with pytest.raises(InvalidArgumentError, match=message):
        make_policy(name, env)


def _noted(folder, observation):
    """Writes a policy whose file names what it observes."""
    import torch

    module = torch.nn.Linear(ROPE + 8, 8)
    program = torch.export.export(module, (torch.zeros(1, ROPE + 8),))
    note = {"observation": observation, "image_size": [8, 8], "task": "straighten_rope"}
    extra = {NOTE: json.dumps(note)}
    torch.export.save(program, folder / "policy_3.pt2", extra_files=extra)
    return str(folder / "policy_{seed}.pt2")


def test_a_policy_observes_what_its_file_names(env, tmp_path):
    name = _noted(tmp_path, "markov")
    configuration = Configuration("straighten_rope", name, (800,), (3,), SHORT)
    assert configuration.settings == {**SHORT, "observation": "markov"}
    given = Configuration("straighten_rope", name, (800,), (3,), configuration.settings)
    assert given.settings == configuration.settings
    result = evaluate(configuration, tmp_path / "evaluation", trust=True)
    assert np.isfinite(result["summary"]["mean"])
    with pytest.raises(InvalidArgumentError, match=r"observation='full'.*'markov', with which"):
        Configuration("straighten_rope", name, (800,), (3,), {"observation": "full"})
    act = make_policy(name, env, 3, trust=True)
    with pytest.raises(InvalidArgumentError, match=r"observation='markov'; .* observes reduced"):
        act(env.reset(800))
    alone, among = (
        softgym_mj.load("straighten_rope", split="all", observation=names, **SHORT).reset(800)
        for names in ("markov", ["held", "markov"])
    )
    np.testing.assert_array_equal(act(among), act(alone))


def test_the_message_for_another_task_names_that_of_the_training(tmp_path):
    cloth = softgym_mj.load("fold_cloth", split="all", observation="markov", fidelity="fast")
    act = make_policy(_noted(tmp_path, "markov"), cloth, 3, trust=True)
    message = rf"shape \(1, {ROPE + 8}\).* of observation='markov' in straighten_rope; choose its"
    with pytest.raises(InvalidArgumentError, match=message):
        act(cloth.reset(800))


def test_policies_of_images_name_their_size_and_others_nothing(tmp_path):
    name = _noted(tmp_path, "rgb")
    none = name.format(seed=4)
    assert observes(name.format(seed=3)) == {"observation": "rgb", "image_size": [8, 8]}
    assert observes(none) == observes("scripted") == {}  # There is no such file.
    exported(tmp_path / "policy_4.pt2")
    assert observes(none) == {}
    with zipfile.ZipFile(none, "a") as archive:
        archive.writestr(f"archive/extra/{NOTE}", "{}")
    with pytest.raises(InvalidArgumentError, match="its observation cannot be read"):
        observes(none)


@pytest.mark.parametrize("name", [5, None, zip])
def test_policies_have_names(name):
    with pytest.raises(InvalidArgumentError, match=r"policy=.*expected a string"):
        make_policy(name, softgym_mj.load("straighten_rope"))
