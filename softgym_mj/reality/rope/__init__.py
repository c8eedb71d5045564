"""Cables held by two robots, simulated against recordings of their markers."""
