"""How fast data sets are made and read, and how large they are."""
