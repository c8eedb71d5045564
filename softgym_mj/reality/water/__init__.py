"""Recordings of real water, dam breaks and sloshing, and their simulation."""
