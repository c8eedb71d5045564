"""System identification: solver parameters that reproduce recorded motions, with intervals."""
