"""`Session`: a task that is played in real time, by a person or a policy, whatever shows it."""

import dataclasses
import queue
import time
from collections.abc import Callable
from typing import Any

from softgym_mj.envs.environment import Environment
from softgym_mj.envs.load import load
from softgym_mj.policies.factory import make_policy
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.variations.indices import NUM_VARIATIONS
from softgym_mj.viewing.teleoperation import Teleoperation, teleoperate

TELEOPERATE = "teleoperate"  # The policy that a person is.
_UNLIMITED = 10**9  # Env steps of an episode that a person plays: until it is reset.
FRAME_STEPS = 2  # Sim steps from one picture to the next: 50 pictures a second.
LINGER = 1.5  # [s] How long the end of a policy's episode is shown before it starts again.
_MOST_BEHIND = 0.1  # [s] What cannot be simulated in real time is not made up for later.


class Pace:
    """Holds simulated time back to real time.

    Attributes:
        speed: simulated time over real time of the last second or so.
    """

    _WINDOW = 1.0  # [s] Over which the speed is measured.

    def __init__(
        self,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ):
        """Starts now.

        Args:
            clock: real time [s].
            sleep: waits for some real time [s].
        """
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


@dataclasses.dataclass(frozen=True)
class Status:
    """What there is to tell of an episode.

    Attributes:
        variation: index 0..999.
        policy: who acts.
        paused: whether time stands still.
        ended: whether the episode is over, which happens to policies only.
        time: simulated since its start [s].
        reward: of the last env step.
        normalized_performance: after the last env step.
        speed: simulated time over real time.
    """

    variation: int
    policy: str
    paused: bool
    ended: bool
    time: float
    reward: float
    normalized_performance: float
    speed: float

    def rows(self) -> list[tuple[str, str]]:
        """Names and values as text, for people."""
        state = "paused" if self.paused else "ended" if self.ended else "running"
        return [
            ("variation", str(self.variation)),
            ("policy", f"{self.policy}, {state}"),
            ("time", f"{self.time:.1f} s (x {self.speed:.1f})"),
            ("reward", f"{self.reward:.3f}"),
            ("normalized performance", f"{self.normalized_performance:.3f}"),
        ]


class Session:
    """Plays a task's own environment step by step, with pictures on the way.

    Env steps are as long as everywhere else, so what a person does is an ordinary episode. All of
    it happens in the thread that calls `advance`; others hand over what is to be done by `post`.

    Attributes:
        env: the environment; another one after a change between a person and a policy.
        teleoperation: what a person drives; None while a policy acts.
        paused: whether time stands still.
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
            policy: "teleoperate" for a person, or as in `make_policy`.
            variation: index 0..999.
            pace: what holds back simulated time; None for real time.
            trust: whether a policy's file may be loaded, as in `make_policy`.
            **settings: of the task, as in `load`.

        Raises:
            InvalidArgumentError: for a bad argument.
        """
        self._task, self._settings, self._trust = task, settings, trust
        self._pace = Pace() if pace is None else pace
        self._posted: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._envs: dict[bool, Environment] = {}
        self.env: Environment = self._environment(policy == TELEOPERATE)
        self.paused = False
        self.on_frame: Callable[[], object] = lambda: None
        self.play(policy, variation)

    def post(self, function: Callable[[], object]) -> None:
        """Has a function called before the next env step; for other threads."""
        self._posted.put(function)

    def play(self, policy: str | None = None, variation: int | None = None) -> None:
        """Starts an episode.

        Args:
            policy: who acts; None for the same as before.
            variation: index 0..999; None for the same as before.
        """
        if variation is None:
            variation = self.env.task.variation
        if policy is not None:
            self.env = self._environment(policy == TELEOPERATE)
            self.teleoperation: Teleoperation | None = None
            if policy == TELEOPERATE:
                self.teleoperation = teleoperate(self.env)
            else:
                self._act = make_policy(policy, self.env, trust=self._trust)
            self._policy = policy
        self._timestep = self.env.reset(variation)
        if self.teleoperation is not None:
            self.teleoperation.start()
        self._sim_steps, self._lingered = 0, 0.0

    def play_next(self) -> None:
        """Starts an episode of the next variation."""
        self.play(variation=(self.env.task.variation + 1) % NUM_VARIATIONS)

    def _environment(self, by_hand: bool) -> Environment:
        if by_hand not in self._envs:
            horizon = _UNLIMITED if by_hand else None
            env = load(self._task, split="all", horizon=horizon, **self._settings)
            env.add_extra_hook("after_substep", self._after_sim_step)
            self._envs[by_hand] = env
        return self._envs[by_hand]

    def _after_sim_step(self, physics, random_state) -> None:
        self._sim_steps += 1
        if self._sim_steps % FRAME_STEPS == 0:
            self._show()

    def _show(self) -> None:
        self.on_frame()
        self._pace.wait(FRAME_STEPS * SIM_STEP)

    def advance(self) -> None:
        """Does what was posted; if nothing was, does one env step, or shows a picture if paused.

        A viewer has to look at `env` after it: what was posted may have changed the model.
        """
        if not self._posted.empty():
            while not self._posted.empty():
                self._posted.get()()
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
    def status(self) -> Status:
        """What there is to tell of the episode now."""
        return Status(
            variation=self.env.task.variation,
            policy=self._policy,
            paused=self.paused,
            ended=self._timestep.last(),
            time=self._sim_steps * SIM_STEP,
            reward=self._timestep.reward or 0.0,
            normalized_performance=float(self.env.info()["normalized_performance"]),
            speed=self._pace.speed,
        )
