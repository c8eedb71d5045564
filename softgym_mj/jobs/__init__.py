"""Work that takes long and may be killed: who does it, and files that are whole or absent."""
