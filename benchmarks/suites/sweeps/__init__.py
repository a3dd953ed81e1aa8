"""Lines of pictures along which one condition changes: lamp, level of black, exposure."""
