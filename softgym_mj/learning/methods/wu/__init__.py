"""Pick-and-place by pixels (Wu et al., 2020)."""
