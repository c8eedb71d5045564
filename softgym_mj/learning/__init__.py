"""Training of policies: learning methods, checkpoints, logs and published results."""
