"""``python -m benchmarks.codecs``: errors of markers by the compression of video."""
