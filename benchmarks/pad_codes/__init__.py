"""Parts of coded pads, registered by their cells and bits."""
