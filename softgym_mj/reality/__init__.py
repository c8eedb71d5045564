"""Realism of cloth: against theory (`lab`), and against recordings of real cloth."""
