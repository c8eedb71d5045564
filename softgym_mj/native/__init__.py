"""Shared C++ code of the engine plugins, their build and the built library."""
