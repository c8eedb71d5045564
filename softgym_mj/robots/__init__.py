"""Actors: pickers, movers of cups, and robot arms; environments use only `base.Actor`."""
