"""Playing by hand: targets become actions, in an ordinary episode in real time."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.viewing.session import FRAME_STEPS, LINGER, Pace, Session
from softgym_mj.viewing.teleoperation import teleoperate


def started(task, **settings):
    """An environment without end, and what drives it."""
    env = softgym_mj.load(task, split="all", horizon=10_000, **settings)
    env.reset(800)
    hand = teleoperate(env)
    hand.start()
    return env, hand


def unhurried(task, *arguments, **settings):
    """A session that does not wait for real time."""
    pace = Pace(clock=lambda: 0.0, sleep=lambda duration: None)
    return Session(task, *arguments, pace=pace, **settings)


def drive(env, hand, steps):
    """Env steps towards the targets; their actions."""
    actions = []
    for _ in range(steps):
        actions.append(hand.action())
        env.step(actions[-1])
    assert np.abs(actions).max() <= 1.0
    return np.array(actions)


# ---------------------------------------------------------------------- targets and actions


def test_pickers_go_straight_to_their_targets_at_half_a_meter_a_second():
    env, hand = started("straighten_rope")
    assert hand.names == ("picker 1", "picker 2")
    start = env.task.actor.positions()
    ways = np.array([[0.2, 0.1, 0.1], [-0.05, 0.0, 0.0]])
    for part, way in enumerate(ways):
        hand.shift(part, [*way, 0.0])
    drive(env, hand, 3)
    stride = 0.5 * env.control_timestep()  # 4 cm in an env step.
    np.testing.assert_allclose(
        env.task.actor.positions()[0] - start[0], 3 * stride * ways[0] / np.sqrt(0.06), atol=1e-9
    )
    np.testing.assert_allclose(env.task.actor.positions()[1], start[1] + ways[1], atol=1e-9)
    drive(env, hand, 4)  # 24.5 cm take 6.1 env steps.
    np.testing.assert_allclose(env.task.actor.positions(), start + ways, atol=1e-9)
    assert np.all(drive(env, hand, 1)[0].reshape(2, 4)[:, :3] == pytest.approx(0.0))
    hand.aim(1, [9.0, -9.0, -1.0, 0.0])
    low, high = env.task.actor.limits
    np.testing.assert_allclose(hand.targets[1, :3], [high[0], low[1], low[2]])


def test_each_grip_takes_and_lets_go_what_is_in_reach():
    env, hand = started("straighten_rope")
    ends = env.task.rope.points()[list(env.task.rope.ends)]
    for part, end in enumerate(ends):
        hand.aim(part, [*end[:2], 0.04, 0.0])
    drive(env, hand, 15)
    hand.grips[1] = True
    drive(env, hand, 1)
    assert (env.task.actor.held >= 0).tolist() == [False, True]
    hand.grips[0] = True
    drive(env, hand, 1)
    assert set(env.task.actor.held) <= set(range(3)) | set(range(38, 41))  # Near the ends.
    before = env.info()["normalized_performance"]
    hand.aim(0, [-0.25, 0.0, 0.03, 0.0])
    hand.aim(1, [0.25, 0.0, 0.03, 0.0])
    drive(env, hand, 25)
    assert env.info()["normalized_performance"] > max(0.8, before)
    hand.grips = [False, False]
    drive(env, hand, 1)
    assert (env.task.actor.held < 0).all()


def test_a_cloth_that_hangs_stays_in_the_grips():
    env, hand = started("drop_cloth")
    assert hand.grips == [True, True]
    drive(env, hand, 1)
    assert (env.task.actor.held >= 0).all()


def test_arms_follow():
    env, hand = started("straighten_rope", actor="sawyer")
    assert hand.names == ("arm 1", "arm 2")
    start = hand.commanded()[:, :3]
    ways = np.array([[0.1, 0.05, 0.05], [-0.1, 0.0, 0.1]])
    for part, way in enumerate(ways):
        hand.shift(part, [*way, 0.0])
    drive(env, hand, 4)
    np.testing.assert_allclose(env.task.actor.commanded_positions(), start + ways, atol=1e-9)
    drive(env, hand, 8)
    np.testing.assert_allclose(env.task.actor.positions(), start + ways, atol=0.005)


@pytest.mark.parametrize("actor", ["cup", pytest.param("franka", marks=pytest.mark.slow)])
def test_a_cup_goes_and_turns_to_its_target(actor):
    env, hand = started("pour_water", actor=actor, fidelity="fast")
    assert hand.turns and not hand.can_grip
    hand.aim(0, [-0.1, 5.0, 0.15, 0.3])
    np.testing.assert_allclose(hand.targets, [[-0.1, 0.0, 0.15, 0.3]])
    # To and from 0.34 m/s at 0.75 m/s^2: 0.15 m take 2 sqrt(0.15 / 0.75) s, some steps more as
    # speed changes once in an env step.
    steps = int(2 * np.sqrt(0.15 / 0.75) / env.control_timestep()) + 4
    actions = drive(env, hand, steps)
    np.testing.assert_allclose(hand.commanded(), hand.targets, atol=1e-6)
    change = np.diff(actions, axis=0, prepend=0.0)[:, :2]
    assert np.abs(change).max() <= 0.75 * env.control_timestep() + 1e-9  # 1 is 1 m/s.
    drive(env, hand, 6)
    np.testing.assert_allclose(env.task.cup.pose, [-0.1, 0.15, 0.3], atol=0.015)


def test_a_cup_that_slides_does_not_turn_and_spills_nothing():
    env, hand = started("transport_water", fidelity="fast")
    assert not hand.turns
    hand.aim(0, [1.2, 0.0, 0.4, 1.0])
    np.testing.assert_allclose(hand.targets, [[1.2, 0.0, 0.0, 0.0]])
    drive(env, hand, 40)  # 1.2 m at 0.6 m/s and 0.8 s for speeding up take 2.8 s: 35 env steps.
    assert env.info()["normalized_performance"] > 0.98


def test_a_blocked_cup_slides_on():
    """On its way to the other side of the target cup it meets its wall, and climbs over it."""
    env, hand = started("pour_water", fidelity="fast")
    beyond = env.task.target.pose[0] + 0.5
    low = env.task.target.size.height * 0.5
    hand.aim(0, [beyond, 0.0, low, 0.0])
    drive(env, hand, 25)
    stopped = hand.commanded()[0]
    assert stopped[0] < env.task.target.pose[0] and stopped[2] == pytest.approx(low, abs=1e-6)
    hand.aim(0, [beyond, 0.0, env.task.target.size.height + 0.05, 0.0])
    drive(env, hand, 60)
    np.testing.assert_allclose(hand.commanded(), hand.targets, atol=1e-6)


def test_a_policy_that_cannot_be_made_ends_no_session():
    session = unhurried("straighten_rope")
    session.post(lambda: session.play("nope"))
    session.advance()
    assert "policy='nope'" in dict(session.status())["refused"]
    session.advance()
    assert session.time > 0.0 and session.policy == "teleoperate"
    session.post(session.play_next)
    session.advance()
    assert "refused" not in dict(session.status())


def test_actors_that_go_all_the_way_at_once_cannot_be_driven():
    with pytest.raises(InvalidArgumentError, match=r"'pick_and_place'.*'picker', 'franka'.*'cup'"):
        Session("straighten_rope", actor="pick_and_place")


def test_bodies_belong_to_parts():
    for task, actor, bodies in (
        ("straighten_rope", "picker", {"picker/picker_1": 1, "rope/flex_3": None}),
        ("straighten_rope", "franka", {"arms/franka_1/link3": 1, "arms/franka_0/hand": 0}),
        ("pour_water", "sawyer", {"arms/sawyer_0/right_l2": 0, "target/cup": None}),
        ("straighten_rope", "ur5e", {"arms/ur5e_1/wrist_1_link": 1, "arms/ur5e_0/hand": 0}),
    ):
        env, hand = started(task, actor=actor)
        names = {env.physics.model.body(i).name for i in range(env.physics.model.nbody)}
        assert set(bodies) <= names
        assert {body: hand.part_of(body) for body in bodies} == bodies


# ---------------------------------------------------------------------- sessions


def test_what_a_person_does_is_an_ordinary_episode():
    """The same actions in another environment give the same bits; pictures come in between."""
    session = unhurried("straighten_rope", variation=803)
    frames = []
    session.on_frame = lambda: frames.append(session.env.physics.data.time)
    session.teleoperation.shift(0, [0.1, 0.1, -0.05, 0.0])
    session.teleoperation.grips[0] = True
    env = softgym_mj.load("straighten_rope", split="all")
    env.reset(803)
    for _ in range(5):
        env.step(session.teleoperation.action())
        session.advance()
    np.testing.assert_array_equal(env.get_state().physics, session.env.get_state().physics)
    np.testing.assert_allclose(np.diff(frames), FRAME_STEPS * 0.01)
    assert len(frames) == 5 * 8 // FRAME_STEPS
    performance = f"{env.info()['normalized_performance']:.3f}"
    assert dict(session.status())["normalized performance"] == performance
    assert session.time == pytest.approx(0.4)


def test_pausing_stops_time_and_posts_come_first():
    session = unhurried("straighten_rope")
    frames = []
    session.on_frame = lambda: frames.append(None)
    session.post(lambda: setattr(session, "paused", True))
    session.advance()
    session.advance()
    assert session.paused and session.time == 0.0 and len(frames) == 1


def test_the_expert_plays_to_the_end_and_again():
    session = unhurried("straighten_rope", "scripted", 800)
    assert session.teleoperation is None
    best = 0.0
    for _ in range(session.env.horizon):
        session.advance()
        best = max(best, session.env.info()["normalized_performance"])
    assert session.ended and best > 0.95
    for _ in range(round(LINGER / (FRAME_STEPS * 0.01))):
        assert session.ended
        session.advance()
    assert session.time == 0.0 and session.variation == 800
    session.play("teleoperate", 801)
    assert session.env.horizon > 1000 and session.variation == 801


def test_simulated_time_is_held_back_to_real_time():
    now, slept = [0.0], []

    def sleep(duration):
        slept.append(duration)
        now[0] += duration

    pace = Pace(lambda: now[0], sleep)
    for _ in range(100):
        now[0] += 0.005  # Work takes 5 ms.
        pace.wait(0.02)
    assert now[0] == pytest.approx(2.0) and pace.speed == pytest.approx(1.0, rel=0.02)
    slept.clear()
    for _ in range(100):
        now[0] += 0.04
        pace.wait(0.02)
    assert not slept and pace.speed == pytest.approx(0.5, rel=0.02)
    for _ in range(12):  # What was lost is not made up for, but for a tenth of a second.
        now[0] += 0.01
        pace.wait(0.02)
    assert sum(slept) > 0.0


def test_a_rehearsal_of_an_expert_is_not_shown():
    session, shown = unhurried("rope_configuration", "scripted", 800, fidelity="fast"), []
    session.on_frame = lambda: shown.append(session.env.physics.time())
    session.advance()
    sim_steps = session.env.task.action_repeat
    np.testing.assert_allclose(shown, [0.01 * k for k in range(2, sim_steps + 1, FRAME_STEPS)])
