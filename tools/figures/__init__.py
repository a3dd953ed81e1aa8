"""Every picture and generated page of the documentation, drawn by the project's own code.

``python -m tools.figures`` writes them again; ``tests/docs/test_docs.py`` compares them with what is committed.
"""
