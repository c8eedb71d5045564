"""How real it is: distances from recordings of real cloth, and what reads such recordings."""
