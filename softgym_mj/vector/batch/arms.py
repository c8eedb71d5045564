"""`ArmClothBatch`: batch physics of a rope or cloth with robot arms."""

import functools
import math
from typing import Any

import jax
import numpy as np

from softgym_mj.cloth.batch_solver import SolidMotion, describe
from softgym_mj.entities.flex import GRIPPER_CONTACT
from softgym_mj.exceptions import cpu_only
from softgym_mj.metrics import Array, constant
from softgym_mj.robots.arm import bodies
from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm_batch import models
from softgym_mj.robots.arm_batch.contacts import KNOWN, Fixed, read_fixed
from softgym_mj.robots.arm_batch.pushed import Push, PushedArms, kinds_of
from softgym_mj.robots.arm_batch.sharing import put
from softgym_mj.robots.arm_batch.state import joint_views, packed
from softgym_mj.robots.grip import NONE
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.arm_grips import AttachGrips, FrictionGrips, HandGrips
from softgym_mj.vector.batch.cloth import ClothBatch
from softgym_mj.vector.batch.jax_arms import JaxArms
from softgym_mj.vector.batch.physics import Arrays

# State of grips in `Arms.get_state`.
GRIPS = "center", "held", "offset", "dropped", "yielded", "order", "solid", "workspace"


class ArmClothBatch(JaxArms, ClothBatch):
    """Batch physics of one flex that arms hold and push.

    Sim steps of the arms, by JAX, alternate with those of the flex. State of the arms: "arms", with
    the arrays of `read_state` and those of `Ended`.
    """

    _actor: Arms

    def _check(self, task: Task) -> None:
        if not isinstance(task.actor, Arms):
            raise cpu_only(f"actor={task.actor.name!r}")
        self._check_steps(task)

    @functools.cached_property
    def _arms(self) -> PushedArms:
        own = self._actor
        return self._compiled(PushedArms, own.arm, own.mounts, *kinds_of(own))

    def _unmet(self) -> list[str]:
        model = self._env.physics.model.ptr
        return [model.geom(i).name for i in self._static if model.geom_type[i] not in KNOWN]

    def _solids(self) -> tuple[int, int]:
        return len(self._geoms) + len(self._static), len(self._actor.arm.joints) + 2

    @functools.cached_property
    def _hand_solids(self) -> slice:
        """Indices of the hands' solids among all, which are in the order of their ids."""
        first = sum(solid < self._geoms[0] for solid in self._static)
        assert sum(solid < self._geoms[-1] for solid in self._static) == first, "in one place"
        return slice(first, first + len(self._geoms))

    @property
    def _attaches(self) -> bool:
        """Whether hands hold by attachment, not by friction."""
        return kinds_of(self._actor)[0] == "attach"

    @property
    def _notes_pushes(self) -> bool:
        return not self._attaches

    def _grips(self, num_envs: int) -> HandGrips:
        xp, zeros, number = self._xp, self._device.zeros, self._actor.num_grippers
        (solids, dofs), lead = self._solids(), (num_envs, number)
        # CUDA graphs refer to addresses: results of JAX are copied into these arrays.
        sizes = {"points": 3, "velocities": 3}
        self._hands = {name: zeros((*lead, size), "float64") for name, size in sizes.items()}
        self._hands["closed"] = zeros(lead, "bool")
        each = {
            "poses": (7,), "velocities": (6,), "accelerations": (6,),
            "jacobians": (6, dofs), "responses": (dofs, 6),
        }  # fmt: skip
        self._moved = {
            name: zeros((num_envs, solids, *size), "float64") for name, size in each.items()
        }
        # Fixed solids touch always, and do not move.
        self._moved["touching"] = self._device.put(np.ones((num_envs, solids), bool))
        self._actions = zeros((num_envs, self._actor.action_size), "float64")
        kind = AttachGrips if self._attaches else FrictionGrips
        return kind(self.state, xp, self._hands)

    # ------------------------------------------------------------------ the environment

    @functools.cached_property
    def _names(self) -> list[str]:
        """Name prefixes of each arm's elements in the scene."""
        arm, root = self._actor.arm, self._actor.mjcf_model.model
        return [f"{root}/{name}/" for name in bodies.names(arm, self._actor.num_grippers)]

    @property
    def _geoms(self) -> list[int]:
        """Ids of the hands' solids, ascending."""
        alone, solids = models.solid_model(self._actor.arm, kinds_of(self._actor)[0])
        names, model = [_own(alone.geom(i).name) for i in solids], self._env.physics.model.ptr
        return [model.geom(prefix + name).id for prefix in self._names for name in names]

    def movers(self) -> list[int]:
        alone, _ = models.solid_model(self._actor.arm, kinds_of(self._actor)[0])
        names = [_own(alone.body(i).name) for i in np.flatnonzero(alone.body_treeid >= 0)]
        model = self._env.physics.model.ptr
        return [model.body(prefix + name).id for prefix in self._names for name in names]

    def _described(self) -> np.ndarray:
        model, number = self._env.physics.model.ptr, self._actor.num_grippers
        pads = self._actor.servos.fingers.pads
        before = model.geom_contype[pads]
        model.geom_contype[pads] = GRIPPER_CONTACT  # Pads that do not push now may push later.
        described = describe(model, [-1] * number, solids=sorted([*self._geoms, *self._static]))
        model.geom_contype[pads] = before
        return described

    def _actor_state(self) -> dict[str, Any]:
        actor, state = self._actor, self._actor.get_state()
        arms = self._read(actor, self.movers())
        arms["at_reach"] = np.array(actor.at_reach)
        arms["remembered"] = arms["remembered"][4 * actor.num_grippers :]
        grips = {name: state[name] for name in GRIPS if name in state}
        if not self._static:
            return {**grips, "arms": arms}
        hand = self._geoms[: len(self._geoms) // actor.num_grippers]
        physics = self._env.physics
        fixed = read_fixed(physics.model.ptr, physics.data.ptr, hand, self._static)
        return {**grips, "arms": arms, "fixed": fixed}

    def _actor_arrays(self) -> Arrays:
        return joint_views(self._actor.servos)

    # ------------------------------------------------------------------ environments

    def command(self, actions: Array) -> None:
        super().command(actions)
        self._actions[...] = actions
        if self._static:
            first, poses = self._hand_solids.start, self._moved["poses"]
            poses[:, :first] = self.state["static_poses"][:, :first]
            poses[:, self._hand_solids.stop :] = self.state["static_poses"][:, first:]

    def begin_sim_step(self) -> None:
        """Applies the flex's push of the last sim step, then steps the arms without the flex."""
        arms, phase = self._arms, self._count % SOLVE_EVERY
        with jax.enable_x64(True):
            if self._count == 0:
                self._now = self._shared(packed(self.state["arms"]))
                self._action, push = self._shared(self._actions), self._no_push
                fixed = self._shared(self.state.get("fixed", {}))
                self._fixed = {kind: Fixed(**solids) for kind, solids in fixed.items()}
            else:
                push = self._pushed()
            if phase == 0:
                self._now = arms.solve(self._now, self._action)
            solid = self._shared(self.state["solid"])
            told = self._action, self._shared(self._vertices()), self._fixed, solid
            self._now, self._push, hands = arms.step_alone(self._now, push, *told, phase)
        solids = {**hands.solids._asdict(), "jacobians": hands.jacobians}
        solids["responses"] = self._push.responses
        moved = {name: array[:, self._hand_solids] for name, array in self._moved.items()}
        for into, arrays in ((self._hands, hands._asdict()), (moved, solids)):
            put(into, {name: arrays[name] for name in into if name in arrays})
        put(self.state, {"solid": hands.solid})
        if self._count > 0:
            self._sense(self._hands["points"])
        # JAX and PyTorch queue work separately and wait for each other where arrays are shared.
        # The last results may be overwritten only now that such a wait has been queued.
        self._results = hands, told, push
        self._count += 1

    def _vertices(self) -> Array:
        """Returns positions of vertices (num_envs, v, 3) [m]; infinite ones do not exist."""
        return self._padded(self.state["origin"].shape[1], math.inf)

    def finish(self) -> None:
        with jax.enable_x64(True):
            state, ended = self._arms.finish(self._now, self._pushed())
        self._end(state, ended)
        points = self.state["arms"]["sensed"][:, : 3 * self._actor.num_grippers]
        self._sense(points.reshape((len(points), -1, 3)))

    @functools.cached_property
    def _no_push(self) -> Push:
        return self._arms.no_push(len(self._actions), self._jax_device)

    def _pushed(self) -> Push:
        """Returns the push in the last sim step."""
        impulses = self._solver.solid_impulses[:, self._hand_solids]
        lead = len(impulses), self._actor.num_grippers, -1
        return self._push._replace(impulses=self._shared(impulses.reshape((*lead, 2, 6))))

    def _sense(self, tools: Array) -> None:
        """Ends a sim step with tool points (num_envs, n, 3) [m]."""
        grips, room = self._pickers, self.state["present"].shape[1]
        if not isinstance(grips, FrictionGrips):
            return
        pushes = self._solver.pushes[:, self._hand_solids, :room]
        each = pushes.reshape((len(pushes), self._actor.num_grippers, -1, room))
        pads = np.flatnonzero(self._arms.is_pad).tolist()
        pushed = self._xp.stack([each[:, :, pad] for pad in pads], axis=2)
        grips.sense(tools, self._offsets, pushed)

    def sim_step(self) -> None:
        if self._attaches:
            super().sim_step()
            return
        self._step(self._xp.zeros_like(self.state["center"]))

    def _step(self, goals: Array) -> None:
        solid = self.state["solid"][..., None]
        touching = solid | ~constant(self._arms.is_pad, solid)
        self._moved["touching"][:, self._hand_solids] = touching.reshape((len(solid), -1))
        motion = SolidMotion(**self._moved)
        held = self.state["held"]
        held = held if self._attaches else self._xp.full_like(held, NONE)
        self._solver.step(self.state["center"], held, goals, motion)

    # ------------------------------------------------------------------ what is seen

    def _remembered(self) -> Array:
        own = self.state["arms"]["remembered"]
        return self._xp.concat([super()._remembered(), own], axis=-1)

    def poses(self) -> Array:
        return self._xp.asarray(self.state["arms"]["poses"], copy=True)

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        arms = self.state["arms"]
        own = {"ik_failures": arms["failures"], "at_reach": arms["at_reach"]}
        return {**super().info(strains, largest), **own}

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        get, state = self._device.get, self.state
        joints, control = self._arms_of(i)
        grips = {name: get(state[name][i]) for name in GRIPS if name in state}
        return {**self._solver.get_state(i), **joints}, {**grips, **control}


def _own(name: str) -> str:
    """Returns an element's name without the model's."""
    return name.rsplit("/", maxsplit=1)[-1]
