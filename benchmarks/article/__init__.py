"""The article's way from triangles to numbers, as a rival to the extractor's."""
