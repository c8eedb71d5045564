"""PyTorch's own layers, with the weights of one of the networks that ours compute together."""

from torch import nn

from softgym_mj.learning.networks import Linear


def plain_layer(linear, k):
    """Returns the dense layer of network number k."""
    own = nn.Linear(*linear.weight.shape[1:])
    own.weight.data, own.bias.data = linear.weight[k].T.clone(), linear.bias[k, 0].clone()
    return own


def plain_network(body, k):
    """Returns network number k of a body of layers."""
    return nn.Sequential(*(plain_layer(x, k) if isinstance(x, Linear) else x for x in body))
