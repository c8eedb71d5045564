"""How real cloth is: against theory (`lab`), and against recordings of real cloth."""
