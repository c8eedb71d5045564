"""Which parameters of the solver move a sheet as a recorded one moved, and how sure that is."""
