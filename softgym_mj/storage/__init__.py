"""Storage: files that are written whole or not at all, values by key, and journals."""
