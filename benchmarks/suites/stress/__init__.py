"""The repeatable images of the stress suite: every kind of damage and distortion at graded strength."""
