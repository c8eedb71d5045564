"""Policies to compare with: scripted experts, planners, and how policies are loaded and played."""
