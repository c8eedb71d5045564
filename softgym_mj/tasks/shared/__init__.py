"""Parts that tasks share: the base class, scenes, observations, measures and start states."""
