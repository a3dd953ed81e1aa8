"""``python -m benchmarks.codecs``: how far the compression of video moves markers."""
