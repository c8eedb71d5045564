"""PlaNet."""
