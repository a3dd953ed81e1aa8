"""The pictures of the tutorials."""
