"""Ways to learn: a file, or a folder, each."""
