"""The article's own algorithms, from its text, to compare with."""
