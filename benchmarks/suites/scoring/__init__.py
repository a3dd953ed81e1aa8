"""Reading, scoring and reporting of the stress suite."""
