"""The formats of shards: WebDataset tar and Parquet.

In: frames, or markers read from pictures. Out: files with the same bytes for the same frames.
"""
