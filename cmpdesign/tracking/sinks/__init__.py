"""Sinks of frames: tables that are written during a run, so that a killed run loses at most some seconds.

In: tracked frames, the columns of a ``FrameTable``. Out: .csv, .npz, .parquet, recordings; after a killed run, the
complete frames. CSV is written to ``FILE.part``. NPZ and Parquet cannot grow, and a recording is complete or does not
exist: their frames are written to the folder ``FILE.part/`` as chunks, each an .npz file, which are assembled at the
end.
"""
