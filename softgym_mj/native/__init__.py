"""What the engine plugins share: the C++ that both use, their build, and the built library."""
