"""Reading of files that others may have written: regular files, sizes, nesting, names, and their errors.

In: a path, or the text of a document. Out: bytes, texts, documents of TOML and JSON, one-line messages.
"""
