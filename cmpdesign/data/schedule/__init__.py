"""Work on many parts at the same time: processes of this machine, or a dask cluster.

In: a function and its arguments. Out: its results, also if workers are lost during the work.
"""
