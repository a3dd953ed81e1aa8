"""Sinks of frames: tables that are written while a run goes on, so that a killed run loses at most some seconds.

In: tracked frames, the columns of a ``FrameTable``. Out: .csv, .npz, .parquet, recordings; after a killed run, its
whole frames. CSV is written to ``FILE.part``. NPZ and Parquet cannot grow, and a recording is to be complete or not
there: their frames go to the folder ``FILE.part/`` as chunks, each an .npz file, which are assembled at the end.
"""
