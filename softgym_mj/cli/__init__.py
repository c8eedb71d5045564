"""The command line `softgym-mj`: one module per group of commands."""
