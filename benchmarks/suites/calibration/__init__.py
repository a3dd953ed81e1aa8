"""Pictures on which stated covariances are held against true errors, and their reading."""
