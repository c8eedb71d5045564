"""`BatchBackend`: environments as rows of arrays, stepped together without MuJoCo."""
