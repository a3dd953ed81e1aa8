"""All pictures and generated pages of the documentation, made by the project's own code.

``python -m docs.figures`` writes them. ``tests/docs/test_docs.py`` compares them with the committed files.
"""
