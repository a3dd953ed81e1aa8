"""The pictures of the documentation, one subject a file."""
