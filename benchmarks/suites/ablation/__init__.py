"""Rules of the reader, each with the change of its source that switches it off, and the trial of one rule."""
