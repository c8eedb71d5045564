"""Learned policies: how they are trained."""
