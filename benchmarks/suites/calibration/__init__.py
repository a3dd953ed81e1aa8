"""Pictures on which stated covariances are compared with true errors, and their reading."""
