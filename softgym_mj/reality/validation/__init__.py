"""What simulated sheets are worth beside recordings of real ones that a user has.

`rag_cases`, `garment_cases` and `marker_cases` check a folder in the layout of a data set, replay
what it holds, and measure; `report` writes what was measured.
"""
