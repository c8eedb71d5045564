"""Robot arms as actors: contract, grasp, distances, limits."""

import numpy as np
import pytest

from softgym_mj.robots.models import ARMS
from tests import test_contract, test_snapshots
from tests.test_contract import actions, make

CASES = [f"{task}/{arm}" for task in ("fold_cloth", "straighten_rope") for arm in ARMS]
cases = pytest.mark.parametrize("case", CASES)


@cases
def test_the_contract_of_every_task_holds(case):
    test_contract.test_specs_match_what_is_returned(case)
    test_contract.test_observations_share_no_memory(case)
    test_contract.test_same_seed_and_actions_give_the_same_bits(case)
    test_contract.test_reward_is_the_sum_of_the_info_terms(case)
    test_contract.test_gymnasium_check_env(case)


@cases
def test_a_restore_continues_bit_equal(case):
    test_snapshots.test_a_restore_continues_bit_equal(case)
