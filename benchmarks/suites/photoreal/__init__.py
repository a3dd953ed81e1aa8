"""Pictures of an independent path tracer: their files, their reading, their score."""
