"""Sets of images and methods that the commands measure on."""
