"""Policies: scripted experts, planners, and loading and playing of saved policies."""
