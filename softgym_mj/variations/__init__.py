"""What differs from episode to episode: initial states by index, and physical parameters."""

from softgym_mj.variations.store import (
    NUM_VARIATIONS,
    SPLITS,
    Initializer,
    VariationStore,
    generator,
)

__all__ = ["NUM_VARIATIONS", "SPLITS", "Initializer", "VariationStore", "generator"]
