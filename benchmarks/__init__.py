"""Every figure that the documentation states: one command each, conditions printed with it."""
