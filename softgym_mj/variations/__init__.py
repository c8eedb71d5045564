"""Variations between episodes: initial states by index, and physical parameters."""

from softgym_mj.variations.indices import NUM_VARIATIONS, SPLITS, Start, generator
from softgym_mj.variations.store import VariationStore

__all__ = ["NUM_VARIATIONS", "SPLITS", "Start", "VariationStore", "generator"]
