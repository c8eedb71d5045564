"""A toy problem for learners: an action moves a point on a line, whose place should become 0.5."""

import torch

from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.replay import Batch

UPDATES, BATCH, STEP = 400, 64, 0.5


def distance_after_learning(algorithm, seeds):
    """Updates an algorithm of some seeds; returns the mean distance that its actions leave."""
    source = generators(seeds, "cpu")
    for _ in range(UPDATES):
        place = drawn(source, BATCH, 1, normal=False)
        action = 2.0 * drawn(source, BATCH, 1, normal=False) - 1.0
        following = (place + STEP * action).clamp(0.0, 1.0)
        reward = -(following - 0.5).abs()[..., 0]
        discount = torch.full((len(seeds), BATCH), 0.9)
        algorithm.update(Batch(place, action, reward, following, discount))
    place = torch.linspace(0.0, 1.0, 9)[None, :, None].expand(len(seeds), -1, -1)
    ends = (place + STEP * algorithm.act(place, explore=False)).clamp(0.0, 1.0)
    return (ends - 0.5).abs().mean()
