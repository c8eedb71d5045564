"""The command line: one file for what belongs together."""
