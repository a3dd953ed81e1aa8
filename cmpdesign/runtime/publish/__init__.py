"""Results of running sensors outside of the process: as messages, to viewers, into files."""
