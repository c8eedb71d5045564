"""Cloth, garments and ropes: the engine plugin that moves flexes, and how to use it in a model."""
