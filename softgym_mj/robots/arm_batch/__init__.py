"""Arms of a batch of environments, computed by JAX: the only folder that imports JAX."""
