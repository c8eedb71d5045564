"""`VectorEnv`: a Gymnasium vector environment on any backend; `make_vec` builds it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from softgym_mj.envs.resets import brief, check_known, checked_options, checked_state
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, SnapshotError, check_count
from softgym_mj.validation import as_array, check_type
from softgym_mj.variations.indices import check_variation
from softgym_mj.vector.backend import Backend
from softgym_mj.vector.variation_sampler import VariationSampler

_State = tuple[Snapshot, Mapping[str, Any]]  # With the state of the generator.


class VectorEnv(gymnasium.vector.VectorEnv):
    """Vector environment: draws variations and resets episodes that a backend simulates.

    An error of one environment is raised here with its own type; after an error in `step`, some
    environments have taken the step and others have not. A call that is interrupted (Ctrl-C, an
    alarm) is still completed by all environments.

    Attributes:
        backend: Simulates the environments.
        autoreset_mode: Gymnasium's mode of automatic resets, also in `metadata`.
    """

    def __init__(self, backend: Backend, variations: Sequence[int], autoreset_mode: AutoresetMode):
        """Takes ownership of a backend, which `close` closes.

        Args:
            backend: Simulates the environments.
            variations: Variation indices to draw from.
            autoreset_mode: Mode of automatic resets, as in `make_vec`.
        """
        self.backend, self.num_envs = backend, backend.num_envs
        self.autoreset_mode = autoreset_mode
        backend.sampler = VariationSampler(backend.num_envs, variations)
        self.metadata = {**backend.metadata, "autoreset_mode": autoreset_mode}
        self.render_mode = backend.render_mode
        self.single_observation_space = backend.observation_space
        self.single_action_space = backend.action_space
        self.observation_space = batch_space(backend.observation_space, self.num_envs)
        self.action_space = batch_space(backend.action_space, self.num_envs)
        self._pending: Callable[[], Any] | None = None  # Waits for the step that has begun.

    def _begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        if self.closed:
            raise LifecycleError("this vector environment was closed: make a new one")
        if self._pending is not None:
            raise LifecycleError("a step has begun: call step_wait() first")
        return self.backend.begin(function, *args)

    def _run(self, function: Callable[..., Any], *args: Any) -> Any:
        return self._begin(function, *args)()

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options=None):
        """Starts episodes.

        Args:
            seed: Seed of the first environment (each next one has one more), or a sequence of
                seeds.
            options: Options of `SoftGymEnv.reset` for all environments; "variation" can also be a
                sequence with one entry per environment, "state" always is. "reset_mask"
                (num_envs,) bool selects environments. "stagger" n shortens these episodes only, by
                (i % n) / n of the horizon for environment i, so that later episodes do not all end
                in the same step; True means n = num_envs.

        Returns:
            Observations and infos of all environments, arrays by name.

        Raises:
            InvalidArgumentError, SnapshotError: If seeds or options are invalid.
        """
        options = checked_options(options)
        check_known(seed, options, ("reset_mask", "stagger"))
        mask = _checked_mask(options.pop("reset_mask", None), self.num_envs)
        stagger = options.pop("stagger", False)
        check_type("stagger", stagger, bool | int)
        is_bool = isinstance(stagger, bool | np.bool_)
        parts = self.num_envs * bool(stagger) if is_bool else check_count("stagger", stagger, 0)
        if "state" in options:
            if parts:
                valid = "False with the option 'state', whose episodes have their own ends"
                raise InvalidArgumentError("stagger", stagger, valid)
            states = _states_of_each(options["state"], self.num_envs)
            return self._run(self._restore, mask, states)
        seeds = _seed_of_each(seed, self.num_envs)
        variations = _variations_of_each(options.get("variation"), self.num_envs)
        return self._run(self._reset, mask, seeds, variations, parts)

    def _reset(
        self, mask: np.ndarray, seeds: list[int | None], variations: list[int | None], parts: int
    ):
        self.backend.settle()
        sampler, chosen = self.backend.sampler, {}
        for i in np.flatnonzero(mask).tolist():
            if (seed := seeds[i]) is not None:
                sampler.seed(i, seed)
            given = variations[i]
            chosen[i] = sampler.next(i) if given is None else given
        if any(variations[i] is None for i in chosen):
            self.backend.expect(sampler.variations)
        self.backend.reset(chosen)
        if parts:
            shares = mask * (np.arange(self.num_envs) % parts) / parts
            self.backend.call("shorten", [((share,), {}) for share in shares])
        return self.backend.observe(), self.backend.infos(mask)

    def _restore(self, mask: np.ndarray, states: Sequence[_State]):
        restored = {i: states[i] for i in np.flatnonzero(mask).tolist()}
        self.backend.settle()
        self.backend.restore({i: snapshot for i, (snapshot, _) in restored.items()})
        for i, (_, generator) in restored.items():
            self.backend.sampler.set_state(i, generator)
        return self.backend.observe(), self.backend.infos(mask)

    def step_async(self, actions: np.ndarray) -> None:
        """Begins an env step without waiting for its end.

        Raises:
            InvalidArgumentError: If an action is invalid; no environment is stepped.
            LifecycleError: If another step has begun; all methods but `close` raise this.
        """
        actions = self.backend.checked(actions)
        self._pending = self._begin(self.backend.advance, actions, self.autoreset_mode)

    def step_wait(self):
        """Waits for the step that `step_async` began; returns and raises what `step` does.

        If the wait is interrupted, the result is lost.

        Raises:
            LifecycleError: If no step has begun.
        """
        if self._pending is None:
            raise LifecycleError("no step has begun: call step_async(actions) first")
        pending, self._pending = self._pending, None
        return pending()

    def step(self, actions: np.ndarray):
        """Applies actions (num_envs, n) in [-1, 1]: `step_async`, then `step_wait`.

        Returns:
            Observations, rewards (num_envs,), terminated, truncated (num_envs,) bool, infos.

        Raises:
            LifecycleError: If an episode has ended and the mode has no automatic resets.
            InvalidArgumentError: If an action is invalid; no environment is stepped.
        """
        actions = self.backend.checked(actions)
        return self._run(self.backend.advance, actions, self.autoreset_mode)

    def render(self) -> tuple[Any, ...] | None:
        """Returns the result of `render` of each environment."""
        return self.call("render")

    def get_state(self) -> list[Any]:
        """Returns a snapshot of each environment for `set_state`, as `SoftGymEnv.get_state`."""
        return self._run(self._states)

    def _states(self) -> list[_State]:
        self.backend.settle()
        snapshots = self.backend.get_state()
        generators = [self.backend.sampler.get_state(i) for i in range(self.num_envs)]
        return list(zip(snapshots, generators, strict=True))

    def set_state(self, states: Sequence[Any]):
        """Restores snapshots of any vector environment, or of single environments, of this task.

        Returns:
            Observations and infos of all environments, arrays by name.
        """
        return self.reset(options={"state": states})

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Calls a method, or reads an attribute, of each environment.

        Use `get_state` for states: the generators of variations are not in the environments.
        """
        return self._run(self.backend.call, name, [(args, kwargs)] * self.num_envs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Returns an attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute of all environments to one value, or to a list or tuple of values.

        Raises:
            InvalidArgumentError: For `clip_actions`, which `make_vec` takes, and for another number
                of values than environments.
        """
        if name == "clip_actions":
            raise InvalidArgumentError("name", name, "another one: make_vec takes clip_actions")
        if not isinstance(values, (list, tuple)):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise InvalidArgumentError(
                "values", values, f"{self.num_envs} values, one per environment"
            )
        nothing: dict[str, Any] = {}
        arguments = [((name, value), nothing) for value in values]
        self._run(self.backend.call, "set_wrapper_attr", arguments)

    def close_extras(self, **kwargs: Any) -> None:
        """Closes the backend; nobody waits for a step that has begun."""
        self._pending = None
        self.backend.close()

    def __reduce__(self) -> NoReturn:
        raise LifecycleError(
            "a VectorEnv cannot be copied or pickled: "
            "make another one and use other.set_state(envs.get_state())"
        )


def _seed_of_each(seed: Any, number: int) -> list[int | None]:
    """Returns a seed per environment.

    A number gives seed, seed + 1, ...; a sequence its entries; None no seeds.
    """
    valid = f"a whole number, 0 or more, or {number} of them"
    try:
        if isinstance(seed, (int, np.integer)):
            first = check_count("seed", seed, 0)
            return list(range(first, first + number))
        given = [None] * number if seed is None else list(seed)
        seeds = [None if one is None else check_count("seed", one, 0) for one in given]
    except (TypeError, InvalidArgumentError):
        raise InvalidArgumentError("seed", seed, valid) from None
    if len(seeds) != number:
        raise InvalidArgumentError("seed", seed, valid)
    return seeds


def _checked_mask(mask: Any, number: int) -> np.ndarray:
    """Returns the option "reset_mask" (number,) bool of environments to reset; None means all."""
    mask = np.ones(number, bool) if mask is None else as_array("reset_mask", mask)
    if mask.shape != (number,) or mask.dtype != bool or not mask.any():
        valid = f"({number},) bool, at least one of them true"
        raise InvalidArgumentError("reset_mask", mask, valid)
    return mask


def _variations_of_each(variation: Any, number: int) -> list[int | None]:
    """Returns a variation per environment from one for all, a sequence, or None.

    Raises:
        InvalidArgumentError: If their number is wrong or one is invalid.
    """
    if isinstance(variation, np.ndarray) and variation.ndim:
        variation = variation.tolist()
    if not isinstance(variation, Sequence):
        return [None if variation is None else check_variation(variation)] * number
    if len(variation) != number:
        valid = f"an index, or one for each of the {number} environments"
        raise InvalidArgumentError("variation", variation, valid)
    return [check_variation(index) for index in variation]


def _states_of_each(states: Any, number: int) -> list[_State]:
    """Returns one checked state per environment.

    Raises:
        SnapshotError: If their number is wrong or one is invalid.
    """
    is_sequence = isinstance(states, Sequence)
    if not is_sequence or len(states) != number:
        shown = f"{type(states).__name__} of length {len(states)}" if is_sequence else brief(states)
        raise SnapshotError(f"expected the states of all {number} environments, not {shown}")
    return [checked_state(state) for state in states]
