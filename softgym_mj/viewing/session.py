"""`Session`: a task in real time, controlled by a user or a policy, for any viewer."""

import queue
import time
from collections.abc import Callable
from typing import Any

from softgym_mj.envs.load import load
from softgym_mj.exceptions import SoftGymError
from softgym_mj.policies.factory import make_policy
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.variations.indices import NUM_VARIATIONS
from softgym_mj.viewing.teleoperation import Teleoperation, teleoperate

TELEOPERATE = "teleoperate"  # Name of the user as a policy.
_UNLIMITED = 10**9  # Horizon of a user's episode: it lasts until the reset.
FRAME_STEPS = 2  # Sim steps per picture: 50 pictures a second.
LINGER = 1.5  # [s] Display time of the end of a policy's episode before the next one.
# [s] Largest delay that is caught up with if the simulation is slower than real time.
_MOST_BEHIND = 0.1


class Pace:
    """Limits simulated time to real time.

    Attributes:
        speed: simulated time over real time of about the last second.
    """

    _WINDOW = 1.0  # [s] Averaging time of the speed.

    def __init__(
        self,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ):
        """Starts the clock; `clock` and `sleep` are those of the module `time` [s]."""
        self._clock, self._sleep = clock, sleep
        self._due = self._since = clock()
        self._simulated = 0.0
        self.speed = 1.0

    def wait(self, duration: float) -> None:
        """Returns when `duration` [s] of simulated time should be over."""
        now = self._clock()
        self._due = max(self._due + duration, now - _MOST_BEHIND)
        if self._due > now:
            self._sleep(self._due - now)
            now = self._clock()
        self._simulated += duration
        if now - self._since >= self._WINDOW:
            self.speed = self._simulated / (now - self._since)
            self._since, self._simulated = now, 0.0


class Session:
    """Runs a task's environment step by step, with pictures in between.

    Env steps are unchanged, so a user's actions make an ordinary episode. All of it runs in the
    thread that calls `advance`; other threads call `post`.

    Attributes:
        env: the environment.
        teleoperation: the user's controller; None while a policy acts.
        policy: name of the policy.
        paused: whether the simulation is paused.
        on_frame: called for every picture: after every second sim step, or as often if paused.
    """

    def __init__(
        self,
        task: str,
        policy: str = TELEOPERATE,
        variation: int = 800,
        pace: Pace | None = None,
        trust: bool = False,
        **settings: Any,
    ):
        """Starts an episode.

        Args:
            task: task name.
            policy: "teleoperate" for a user, or as in `make_policy`.
            variation: index 0..999.
            pace: limits simulated time; None for real time.
            trust: whether a policy's file may be loaded, as in `make_policy`.
            **settings: settings of the task, as in `load`.

        Raises:
            InvalidArgumentError: for a bad argument.
        """
        self._trust = trust
        self._pace = Pace() if pace is None else pace
        self._posted: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self.env = load(task, split="all", **settings)
        self.env.add_extra_hook("after_substep", self._after_sim_step)
        self._horizon = self.env.horizon
        self.paused = False
        self.on_frame: Callable[[], object] = lambda: None
        self.play(policy, variation)

    def post(self, function: Callable[[], object]) -> None:
        """Schedules a function to be called before the next env step; for other threads."""
        self._posted.put(function)

    def play(self, policy: str | None = None, variation: int | None = None) -> None:
        """Starts an episode; None for the same policy or variation as before."""
        if variation is None:
            variation = self.variation
        if policy is not None:
            teleoperation = teleoperate(self.env) if policy == TELEOPERATE else None
            if teleoperation is None:
                self._act = make_policy(policy, self.env, trust=self._trust)
            self.teleoperation: Teleoperation | None = teleoperation
            self.env.horizon = self._horizon if teleoperation is None else _UNLIMITED
            self.policy = policy
        self._timestep = self.env.reset(variation)
        if self.teleoperation is not None:
            self.teleoperation.start()
        self._sim_steps, self._lingered, self._refused = 0, 0.0, ""

    def play_next(self) -> None:
        """Starts an episode of the next variation."""
        self.play(variation=(self.variation + 1) % NUM_VARIATIONS)

    def _after_sim_step(self, physics, random_state) -> None:
        if self.env.is_rehearsing:
            return
        self._sim_steps += 1
        if self._sim_steps % FRAME_STEPS == 0:
            self._show()

    def _show(self) -> None:
        self.on_frame()
        self._pace.wait(FRAME_STEPS * SIM_STEP)

    def advance(self) -> None:
        """Runs the posted functions; without any, an env step, or a picture while paused.

        A viewer must check `env` afterwards: a posted function may have changed the model.
        """
        if not self._posted.empty():
            while not self._posted.empty():
                try:
                    self._posted.get()()
                except SoftGymError as error:  # A request that cannot be met ends nothing.
                    self._refused = str(error)
        elif self.paused:
            self._show()
        elif self._timestep.last():
            self._show()
            self._lingered += FRAME_STEPS * SIM_STEP
            if self._lingered >= LINGER:
                self.play()
        elif self.teleoperation is not None:
            self._timestep = self.env.step(self.teleoperation.action())
        else:
            self._timestep = self.env.step(self._act(self._timestep))

    @property
    def variation(self) -> int:
        """Index of the current variation."""
        return self.env.task.variation

    @property
    def time(self) -> float:
        """Simulated time since the start of the episode [s]."""
        return self._sim_steps * SIM_STEP

    @property
    def ended(self) -> bool:
        """Whether the episode of a policy has ended."""
        return self._timestep.last()

    def status(self) -> list[tuple[str, str]]:
        """Returns the status as (name, value) texts: variation, policy, time, reward, score.

        The last one is the error of a posted function, until the next episode starts.
        """
        state = "paused" if self.paused else "ended" if self.ended else "running"
        performance = float(self.env.info()["normalized_performance"])
        return [
            ("variation", str(self.variation)),
            ("policy", f"{self.policy}, {state}"),
            ("time", f"{self.time:.1f} s (x {self._pace.speed:.1f})"),
            ("reward", f"{self._timestep.reward or 0.0:.3f}"),
            ("normalized performance", f"{performance:.3f}"),
            *([("refused", self._refused)] if self._refused else []),
        ]
