"""What acts: pickers, movers of cups, and robot arms; `base.Actor` is all the environment knows."""
