"""Speed and size of data sets."""
