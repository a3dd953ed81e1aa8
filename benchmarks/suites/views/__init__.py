"""Views of a part of a pattern without its white cell: which motions their cells fit by the truth; their reading."""
