"""Cloth, garments and ropes: the engine plugin that moves flexes, and its Python interface."""
