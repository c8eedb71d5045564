"""The tasks, a module each, with what they share and where their initial states come from."""
