"""Random cameras and their pictures of a sheet, with truth, for the calibration of cameras."""
