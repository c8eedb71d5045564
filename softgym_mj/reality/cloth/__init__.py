"""A cloth on a robot's tool, simulated against recordings of a camera that tracked its nodes."""
